"""Random options of a world inside the allowed ranges, and a soak of one world, for the tests."""

import numpy as np

from hybrid_env import HybridTrackVectorEnv, Radar, RandomScheme, Sensor, WorldOptions
from hybrid_env.checks import ArgumentError

# Standard deviations of the logarithm to base 10: values near 1, and far from it.
SPREADS = (0.3, 1.0, 3.0)
CHOICES = {
    "bank": ("published", "anchor_aware", "oracle"),
    "noise": ("gaussian", "outliers 0.1 1000", "levy 0.5 1000", "levy 2 0.001", "student_t 1"),
    "missed": (0.0, 0.2, 0.99),
    "reset_covariance": (None, True, False),
    "follow": ("declared", "bank"),
    "correctness": ("exact", "type"),
    "evidence": (0.0, 0.5, 0.95, 1.0 - 1e-9),
    "actions": ("all", "types"),
    "observation": ("bank", "raw", "state"),
    "undecided": ("likeliest", "keep"),
    "heading": (None, 2.0),
}


def random_sensors(generator, deviation, reach):
    """Draw up to three position sensors and one radar, often none."""
    if generator.random() < 0.6:
        return ()
    sensors = [
        Sensor(
            variance=float(np.clip((deviation * 10.0 ** generator.normal()) ** 2, 1e-18, 1e18)),
            position=tuple((generator.normal(size=2) * reach).tolist()),
            period=int(generator.integers(1, 30)),
            range=float(10.0 ** generator.normal(0, 2) * reach),
        )
        for _ in range(generator.integers(1, 4))
    ]
    radar = Radar(
        range_deviation=float(deviation * 10.0 ** generator.normal()),
        bearing_deviation=float(10.0 ** generator.uniform(-6, 0)),
        rate_deviation=float(10.0 ** generator.uniform(-9, 9)),
        position=tuple((generator.normal(size=2) * reach).tolist()),
    )
    return [*sensors, radar] if generator.random() < 0.5 else sensors


def draw(generator, longest):
    """Draw the keywords of a world, which may be outside the allowed ratios."""
    spread = generator.choice(SPREADS)
    speed, tau, deviation, noise, cost = (10.0 ** generator.normal(0.0, spread, 5)).tolist()
    radius = speed * tau / 10.0 ** generator.uniform(-6, 2)
    radii = tuple((radius * 10.0 ** np.arange(generator.integers(1, 9))).tolist())
    lengths = np.sort(np.ceil(longest ** generator.random(2)).astype(int))
    variances = deviation**2 * 10.0 ** generator.uniform(-3, 3, 2)
    sensors = random_sensors(generator, deviation, max(radii))
    options = {name: values[generator.integers(len(values))] for name, values in CHOICES.items()}
    return options | {
        "scheme": RandomScheme(int(generator.integers(1, 9)), tuple(lengths.tolist())),
        "radii": radii,
        "speed": speed,
        "tau": tau,
        "process_variance": noise**2 * generator.integers(2),
        "measurement_variance": deviation**2 if sensors else tuple(variances.tolist()),
        "sensors": sensors,
        "initial_error": tuple((10.0 ** generator.normal(0, spread, 2)).tolist()),
        "delay_cost": cost,
    }


def random_options(generator):
    """Draw keywords of an allowed world, with segments of up to 3 to 3,000 ticks."""
    while True:
        options = draw(generator, 3.0 * 10.0 ** generator.uniform(0, 3))
        try:
            WorldOptions(**options)
            return options
        except ArgumentError:
            continue


def soak(options, tracks, ticks, seed):
    """Step a world with random actions, also after terminations, and check every row, reward and
    end.

    Returns:
        number of ticks of all tracks, including those after decisions.
    """
    env = HybridTrackVectorEnv(tracks, tick_info=False, **options)
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
        actions = np.where(generator.random(tracks) < rate, generator.integers(0, count, tracks), 0)
        rows, rewards, terminated, _, info = env.step(actions)
        decided = info.get("_ticks", np.zeros(tracks, bool))
        expected = decided * np.where(info.get("correct", False), 1.0, -1.0) - cost
        np.testing.assert_array_equal(rewards, np.where(restart, 0.0, expected))
        age = np.where(restart, 1, age + 1)
        assert (age <= longest + 1).all(), "an episode does not end"
        done += tracks
        if decided.any():
            done += int((info["decided_length"] - info["ticks"]).sum())
        restart = terminated
