"""The rows of the bank, of the measurement, of the innovations and of the true state belong to
the same episodes, and every feature is what the info says.
"""

import numpy as np
import pytest
from other_units import in_other_units
from scipy.special import softmax

from hybrid_env import (
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    InnovationsLayout,
    Layout,
    QuickestLayout,
    QuickestOptions,
    RawLayout,
    StateLayout,
    WorldOptions,
)
from hybrid_env.live import SQUARE
from hybrid_env.registration import BANK_RADII

TWINS = {"bank": Layout, "raw": RawLayout, "state": StateLayout, "innovations": InnovationsLayout}
CLIMBS = "straight, left 5, climb 0.5, descend 0.3"
TRACKS = 11
PLACES = [0, 2]
TYPES = {"correctness": "type", "actions": "types", "follow": "bank", "evidence": 0.9}
WORLDS = {
    "many turns": TYPES | {"radii": BANK_RADII},
    "climbs": {"modes": CLIMBS, "height_variance": 0.04, "reset_covariance": True},
}


def in_heading_frame(vectors, anchor):
    """Components of vectors (N, ..., 2) along and across the velocity of the anchor (N, 4)."""
    heading = anchor[:, [1, 3]] / np.hypot(anchor[:, 1], anchor[:, 3])[:, None]
    across = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    return [np.einsum("n...k,nk->n...", vectors, axis) for axis in (heading, across)]


def features(env, info, previous):
    """Return what the features of all rows are, by the info of a tick and the previous modes."""
    options, world, every = env.options, env.world, np.arange(env.num_envs)
    R, tau, anchor = np.array(options.variances), options.tau, info["anchor"]
    deviation = np.sqrt(np.sqrt(R.prod()))
    measurement = world.field("measurement")
    missing = np.isnan(measurement[:, 0])
    likelihood = info["log_likelihood"]
    likeliest = likelihood.argmax(1)
    posterior = softmax(likelihood, axis=1)
    posterior[every, likeliest] = 0.0
    spreads = np.diagonal(info["innovation_covariances"], 0, 2, 3)
    radii = np.array([mode.signed_radius for mode in options.all_modes])
    expected_place = info["estimates"][every, likeliest][:, PLACES]
    seen = np.where(missing[:, None], expected_place, measurement) - anchor[:, PLACES]
    P = world.field("covariance")[:, SQUARE]
    truth = info["truth"]
    pairs = {
        "innovation": info["innovations"] / np.sqrt(spreads),
        "displacement": seen / deviation,
        "position": (truth - anchor)[:, PLACES] / deviation,
        "velocity": tau * truth[:, [1, 3]] / deviation,
    }
    known = {
        f"{name}_{axis}": values
        for name, vectors in pairs.items()
        for axis, values in zip(("along", "across"), in_heading_frame(vectors, anchor), strict=True)
    }
    way = tau * np.hypot(anchor[:, 1], anchor[:, 3])
    if options.climbs:
        heights = np.moveaxis(world.bank.heights, -1, 1)
        heights = heights.reshape(-1, *heights.shape[2:])[: env.num_envs]
        up = info["height"] - world.field("anchor_height")
        known |= {
            "innovation_up": np.nan_to_num(heights[..., 5]) / np.sqrt(heights[..., 6]),
            "log_variance_up": np.log(heights[..., 6] / 0.04),
            "climb": tau * info["height_estimate"][:, 1] / 0.2,
            "displacement_up": np.where(missing, 0.0, up) / 0.2,
        }
    return known | {
        "log_ratio": np.maximum(likelihood - likelihood.max(1, keepdims=True), -30.0),
        "log_variance": np.log(spreads / R).mean(2),
        "previous": np.eye(options.hypotheses)[previous],
        "true_mode": np.eye(options.hypotheses)[info["true_mode"]],
        "turn_angle": np.divide(
            way[:, None], radii, where=radii != 0.0, out=np.zeros((TRACKS, len(radii)))
        ),
        "ticks": info["tick"],
        "ticks_left": world.field("length") - info["tick"],
        "log_error_probability": np.maximum(np.log(posterior.sum(1)), -30.0),
        "speed": way / deviation,
        "anchor_xx": (P[:, PLACES, PLACES] / R).mean(1),
        "anchor_xv": tau * (P[:, PLACES, [1, 3]] / R).mean(1),
        "anchor_vv": tau**2 * (P[:, [1, 3], [1, 3]] / R).mean(1),
        "log_noise": 0.0,
        "measured": 1.0 - missing,
    }


@pytest.mark.parametrize("options", WORLDS.values(), ids=WORLDS)
def test_twins_have_the_same_episodes_and_the_features_that_the_info_says(options):
    given = {"scheme": "random 2x5-20", "missed": 0.4, "measurement_variance": (0.05, 0.4)}
    envs = [
        HybridTrackVectorEnv(
            TRACKS, tick_info=True, bank_info=True, observation=name, **given | options
        )
        for name in TWINS
    ]
    results = [env.reset(seed=6) for env in envs]
    generator = np.random.default_rng(1)
    previous, ended, episodes = np.zeros(TRACKS, int), np.zeros(TRACKS, bool), 0
    for _ in range(100):
        known = features(envs[0], results[0][-1], previous)
        for (rows, *others), env in zip(results, envs, strict=True):
            assert env.observation_space.contains(rows)
            np.testing.assert_equal(others, list(results[0][1:]))
            layout = env.world.layout
            assert layout.width == rows.shape[1]
            for name in layout.slices:
                read = layout.read(rows, name)
                expected = np.broadcast_to(known[name], read.shape)
                if env.options.observation == "raw" and name.startswith("displacement"):
                    expected = expected * known["measured"]
                np.testing.assert_allclose(
                    read[~ended], expected[~ended], rtol=1e-5, atol=1e-5, err_msg=name
                )
        declares = generator.random(TRACKS) < 0.2
        actions = declares * generator.integers(0, envs[0].single_action_space.n, TRACKS)
        results = [env.step(actions) for env in envs]
        info, ended = results[0][-1], results[0][2]
        decided = info.get("_decided_mode", np.zeros(TRACKS, bool))
        previous[decided] = info["decided_mode"][decided] if decided.any() else 0
        previous[(info["tick"] == 1) & (info["segment"] == 0)] = 0
        episodes += ended.sum()
    assert episodes > 0


def test_a_width_tells_the_number_of_modes_and_whether_they_climb():
    for layout in (Layout, QuickestLayout):
        made = layout(9, climbs=True)
        assert layout.of_width(made.width).slices == made.slices
        widths = {layout(M).width for M in range(2, 1001)}
        assert widths.isdisjoint({layout(M, True).width for M in range(2, 1001)})


WORLD = {"radii": (2.0, 5.0), "missed": 0.1}
UNITS = [
    (
        HybridTrackVectorEnv,
        WorldOptions(bank="anchor_aware", follow="bank", observation=name, **given),
    )
    for name in TWINS
    for given in (WORLD, {"modes": CLIMBS})
] + [(HybridTrackQuickestVectorEnv, QuickestOptions(modes=CLIMBS, missed=0.1))]


@pytest.mark.parametrize(("make", "world"), UNITS)
def test_rows_are_the_same_in_any_units(make, world):
    rows = []
    for options in (world, in_other_units(world, 1e-3, 1 / 3600)):
        env = make(5, **vars(options))
        seen = [env.reset(seed=3)[0]]
        seen += [env.step(np.full(5, k % 9 == 8, np.int64))[0] for k in range(40)]
        rows.append(np.stack(seen))
    np.testing.assert_allclose(rows[1], rows[0], rtol=2e-4, atol=2e-4)
