"""Random options of a world inside the allowed ranges, and a soak of one world, for the tests."""

import numpy as np
from declared import limits_of

from hybrid_env import (
    FixedScheme,
    HybridTrackVectorEnv,
    Radar,
    RandomScheme,
    Segment,
    Sensor,
    WorldOptions,
)
from hybrid_env.checks import ArgumentError

RANGES = {
    "radii": (1e-12, 1e12),
    "measurement_variance": (1e-18, 1e18),
    "initial_position": (0.0, 1e12),
    "initial_velocity": (0.0, 1e18),
}
"""Of the options of several numbers."""
BANKS = ("published", "anchor_aware", "oracle")
NOISES = (
    *("gaussian",) * 4,
    "outliers 0.05",
    "outliers 0.99",
    "outliers 0.1 1000",
    "levy 1.5 1 44",
    "levy 0.5 1000",
    "levy 1",
    "levy 2 0.001",
    "student_t 3",
    "student_t 1",
)


def log_uniform(generator, name, spread):
    """Draw an option from its range, whose logarithm is scaled by `spread`; sometimes its limit
    or 0.
    """
    low, high = RANGES.get(name) or limits_of(WorldOptions, name)
    if low == 0.0 and generator.random() < 0.2:
        return 0.0
    if generator.random() < 0.03:
        return float(generator.choice((low, high)))
    return float(
        10.0
        ** (
            spread
            * generator.uniform(
                np.log10(low or 1.0 / high),
                np.log10(high),
            )
        )
    )


def random_scheme(generator, radii, longest):
    """Draw a fixed or a random scheme."""
    lengths = np.ceil(longest ** generator.random((8, 2))).astype(int)
    count = int(generator.integers(1, 9))
    if generator.random() < 0.5:
        own = radii if generator.random() < 0.7 else tuple(generator.permutation(radii)[:3] * 1.7)
        return RandomScheme(count, tuple(sorted(lengths[0].tolist())), own)
    pieces = []
    for length in lengths[:count, 0].tolist():
        mode = str(generator.choice(("S", "L", "R")))
        pieces.append(
            Segment(
                mode,
                length,
                None if mode == "S" else float(generator.choice(radii)),
            )
        )
    return FixedScheme(tuple(pieces))


def random_sensors(generator, values, radii):
    """Draw up to four position sensors and two radars, often none."""
    if generator.random() < 0.6:
        return ()
    deviation = float(np.sqrt(values["measurement_variance"]))
    radars = [
        Radar(
            range_deviation=float(np.clip(deviation * 10.0 ** generator.normal(), 1e-9, 1e9)),
            bearing_deviation=float(10.0 ** generator.uniform(-6, 0)),
            rate_deviation=float(10.0 ** generator.uniform(-9, 9))
            if generator.random() < 0.5
            else None,
            position=tuple((generator.normal(size=2) * max(radii)).clip(-1e12, 1e12).tolist()),
            period=int(generator.integers(1, 9)),
        )
        for _ in range(generator.integers(0, 3) * (generator.random() < 0.5))
    ]
    return radars + [
        Sensor(
            variance=float(
                np.clip(
                    values["measurement_variance"] * 10.0 ** generator.normal(0, 2),
                    1e-18,
                    1e18,
                )
            ),
            position=tuple((generator.normal(size=2) * max(radii)).clip(-1e12, 1e12).tolist()),
            period=int(generator.integers(1, 30)),
            range=float(10.0 ** generator.normal(0, 2) * max(radii))
            if generator.random() < 0.5
            else np.inf,
        )
        for _ in range(generator.integers(1, 5))
    ]


def draw(generator, longest):
    """Draw the keywords of a world, which may be outside the allowed ratios."""
    # From values near 1 to the whole range, and with the turn per tick drawn in its own range.
    spread = generator.choice((0.05, 0.15, 0.4, 1.0))
    values = {
        name: log_uniform(generator, name, spread)
        for name in (
            "radii",
            "speed",
            "tau",
            "process_variance",
            "measurement_variance",
            "delay_cost",
            "initial_position",
            "initial_velocity",
        )
    }
    radii = [values["radii"]]
    if generator.random() < 0.5:
        turn = 10.0 ** generator.uniform(-6, 2)
        radii = [values["speed"] * values["tau"] / min(turn, 100.0)]
    ratio = 10.0 ** generator.uniform(0.01, 1.0)
    radii = tuple(float(radii[0] * ratio**k) for k in range(generator.integers(1, 11)))
    variance = values["measurement_variance"]
    unequal = (variance, variance * 10.0 ** generator.uniform(-3, 3))
    unequal_axes = bool(generator.random() < 0.3)
    bank = str(generator.choice(BANKS))
    follow = str(generator.choice(("declared", "bank")))
    return {
        "scheme": random_scheme(generator, radii, longest),
        "radii": radii,
        "speed": values["speed"],
        "heading": None if generator.random() < 0.5 else generator.normal(),
        "tau": values["tau"],
        "process_variance": values["process_variance"],
        "measurement_variance": unequal if unequal_axes else variance,
        "noise": str(generator.choice(NOISES)),
        "missed": float(generator.choice((0.0, 0.0, 0.2, 0.99))),
        "sensors": random_sensors(generator, values, radii) if not unequal_axes else (),
        "initial_error": (values["initial_position"], values["initial_velocity"]),
        "bank": bank,
        "reset_covariance": None if bank == "oracle" else generator.choice((None, True, False)),
        "follow": follow,
        "recalculation": follow == "declared" and bool(generator.random() < 0.5),
        "refine_radius": follow == "declared" and len(radii) > 1 and bool(generator.random() < 0.5),
        "delay_cost": values["delay_cost"],
        "correctness": str(generator.choice(("exact", "type"))),
        "evidence": float(generator.choice((0.0, 0.5, 0.95, 1.0 - 1e-9))),
        "actions": str(generator.choice(("all", "types", "best"))),
        "observation": str(generator.choice(("bank", "bank", "raw", "state"))),
        "undecided": str(generator.choice(("likeliest", "keep"))),
    }


def random_options(generator, longest=None):
    """Draw keywords of an allowed world, with segments of up to `longest` ticks, by default 3 to
    3,000.
    """
    while True:
        try:
            options = draw(generator, longest or 3.0 * 10.0 ** generator.uniform(0, 3))
            WorldOptions(**options)
            return options
        except ArgumentError:
            continue


def soak(options, tracks, ticks, seed, **arguments):
    """Step a world with random actions, also after terminations, and check every row, reward and
    end.

    Returns:
        number of ticks of all tracks, including those after decisions.
    """
    env = HybridTrackVectorEnv(tracks, tick_info=False, **arguments, **options)
    generator = np.random.default_rng(seed)
    rate = 10.0 ** generator.uniform(-2.5, 0.0)
    low, high = env.single_observation_space.low, env.single_observation_space.high
    count = env.single_action_space.n
    cost = env.options.delay_cost
    longest = env.options.segments * env.options.longest_segment
    rows, _ = env.reset(seed=seed)
    age = np.ones(tracks, np.int64)
    done = tracks
    restart = np.zeros(tracks, bool)
    while True:
        assert ((rows >= low) & (rows <= high)).all(), "a row is outside the observation space"
        if done >= ticks:
            assert np.isfinite(env.world.hypothesis_values()).all()
            assert np.isfinite(env.world.field("estimate")).all()
            return done
        actions = np.where(
            generator.random(tracks) < rate,
            generator.integers(0, count, tracks),
            0,
        )
        rows, rewards, terminated, _, info = env.step(actions)
        decided = info.get("_ticks", np.zeros(tracks, bool))
        expected = (
            np.where(
                decided,
                np.where(info.get("correct", False), 1.0, -1.0),
                0.0,
            )
            - cost
        )
        np.testing.assert_array_equal(rewards, np.where(restart, 0.0, expected))
        age = np.where(restart, 1, age + 1)
        assert (age <= longest + 1).all(), "an episode does not end"
        done += tracks
        if decided.any():
            done += int((info["decided_length"] - info["ticks"]).sum())
        restart = terminated


def unit_scales(options, length, time):
    """Return options in which lengths and times are measured in other units."""
    scaled = dict(options)
    scaled["radii"] = tuple(radius * length for radius in options["radii"])
    scaled["speed"] = options["speed"] * length / time
    scaled["tau"] = options["tau"] * time
    scaled["process_variance"] = options["process_variance"] * (length / time) ** 2
    scaled["measurement_variance"] = options["measurement_variance"] * length**2
    position, velocity = options["initial_error"]
    scaled["initial_error"] = (position, velocity * (length / time) ** 2)
    units = {
        "variance": length**2,
        "position": length,
        "range": length,
        "period": 1,
    }
    units |= {
        "range_deviation": length,
        "bearing_deviation": 1,
        "rate_deviation": length / time,
    }
    scaled["sensors"] = [
        {key: np.multiply(value, units[key]).tolist() for key, value in one.items()}
        for one in options.get("sensors", ())
    ]
    return scaled
