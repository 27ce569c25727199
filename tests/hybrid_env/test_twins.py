"""The rows of the bank, of the measurement, of the innovations and of the true state belong to
the same episodes.
"""

import numpy as np
from other_units import in_other_units

from hybrid_env import (
    HybridTrackVectorEnv,
    InnovationsLayout,
    Layout,
    RawLayout,
    StateLayout,
    WorldOptions,
)
from hybrid_env.registration import BANK_RADII

TWINS = {"bank": Layout, "raw": RawLayout, "state": StateLayout, "innovations": InnovationsLayout}
MEASURED = {"missed": 0.4, "measurement_variance": (0.05, 0.4)}


def in_heading_frame(vectors, anchor):
    """Components of vectors (N, 2) along and across the velocity of the anchor (N, 4)."""
    heading = anchor[:, [1, 3]] / np.hypot(anchor[:, 1], anchor[:, 3])[:, None]
    across = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    return (vectors * heading).sum(1), (vectors * across).sum(1)


def test_twins_have_the_same_episodes_and_every_row_is_in_its_space():
    tracks = 11
    envs = [
        HybridTrackVectorEnv(
            tracks,
            tick_info=True,
            observation=name,
            scheme="random 2x5-20",
            bank="anchor_aware",
            evidence=0.9,
            radii=BANK_RADII,
            correctness="type",
            actions="types",
            follow="bank",
            **MEASURED,
        )
        for name in TWINS
    ]
    layouts = [env.world.layout for env in envs]
    results = [env.reset(seed=6) for env in envs]
    generator = np.random.default_rng(1)
    episodes = 0
    for _ in range(100):
        for (rows, *others), env in zip(results, envs, strict=True):
            assert env.observation_space.contains(rows)
            np.testing.assert_equal(others, list(results[0][1:]))
        bank, alone = results[0][0], results[-1][0]
        for name in (*InnovationsLayout.hypothesis_features, *InnovationsLayout.track_features):
            np.testing.assert_array_equal(
                layouts[-1].read(alone, name), layouts[0].read(bank, name)
            )
        declares = generator.random(tracks) < 0.2
        actions = declares * generator.integers(0, envs[0].single_action_space.n, tracks)
        results = [env.step(actions) for env in envs]
        episodes += results[0][2].sum()

    assert episodes > 0


def test_the_layouts_read_the_true_state_and_the_measurement_relative_to_the_anchor():
    tracks = 9
    raw, state = (
        HybridTrackVectorEnv(
            tracks, tick_info=True, observation=name, scheme="L12r8 S9", radii=8.0, **MEASURED
        )
        for name in ("raw", "state")
    )
    R = np.exp(np.log(raw.options.variances).mean())
    raw_layout = RawLayout(raw.options.hypotheses)
    state_layout = StateLayout(state.options.hypotheses)
    (raw_rows, info), (state_rows, _) = raw.reset(seed=2), state.reset(seed=2)
    for tick in range(1, 13):
        anchor = info["anchor"]
        truth = info["truth"]
        places = [0, 2]
        measurement = raw.world.field("measurement")
        missing = np.isnan(measurement[:, 0])
        along, across = in_heading_frame((measurement - anchor[:, places]) / np.sqrt(R), anchor)
        common = {"ticks": tick, "ticks_left": 12 - tick, "log_noise": 0.0}
        of_raw = common | {
            "displacement_along": np.where(missing, 0.0, along),
            "displacement_across": np.where(missing, 0.0, across),
            "measured": 1.0 - missing,
            "speed": 0.1 * np.hypot(anchor[:, 1], anchor[:, 3]) / np.sqrt(R),
        }
        position = in_heading_frame((truth - anchor)[:, places] / np.sqrt(R), anchor)
        velocity = in_heading_frame(0.1 * truth[:, [1, 3]] / np.sqrt(R), anchor)
        of_state = common | {
            "position_along": position[0],
            "position_across": position[1],
            "velocity_along": velocity[0],
            "velocity_across": velocity[1],
            "true_mode": np.eye(state.options.hypotheses)[info["true_mode"]],
        }
        for rows, layout, expected in (
            (raw_rows, raw_layout, of_raw),
            (state_rows, state_layout, of_state),
        ):
            assert expected.keys() == layout.slices.keys()
            for name, value in expected.items():
                np.testing.assert_allclose(layout.read(rows, name), value, rtol=1e-5, atol=1e-5)
        wait = np.zeros(tracks, np.int64)
        (raw_rows, *_, info), (state_rows, *_) = raw.step(wait), state.step(wait)

    assert (info["segment"] == 1).all()


def test_rows_are_the_same_in_any_units():
    for name in TWINS:
        world = WorldOptions(
            radii=(2.0, 5.0), bank="anchor_aware", follow="bank", observation=name, missed=0.1
        )
        rows = []
        for options in (world, in_other_units(world, 1e-3, 1 / 3600)):
            env = HybridTrackVectorEnv(5, **vars(options))
            seen = [env.reset(seed=3)[0]]
            seen += [env.step(np.full(5, k % 9 == 8, np.int64))[0] for k in range(40)]
            rows.append(np.stack(seen))
        np.testing.assert_allclose(rows[1], rows[0], rtol=2e-4, atol=2e-4)
