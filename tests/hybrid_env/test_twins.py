"""The rows of the bank, of the measurement alone and of the true state belong to the same
episodes.
"""

import numpy as np
import pytest

from hybrid_env import HybridTrackVectorEnv, Layout, RawLayout, Sensor, StateLayout
from hybrid_env.registration import BANK_RADII

TWINS = {
    "bank": Layout,
    "raw": RawLayout,
    "state": StateLayout,
}
WORLDS = {
    "default": {},
    "evidence": {
        "bank": "anchor_aware",
        "evidence": 0.9,
        "radii": (3.0, 8.0),
    },
    "types": {
        "bank": "anchor_aware",
        "evidence": 0.9,
        "radii": BANK_RADII,
        "correctness": "type",
        "actions": "types",
        "follow": "bank",
    },
    "missed, unequal axes": {"missed": 0.4, "measurement_variance": (0.05, 0.4)},
    "sensors": {"sensors": (Sensor(variance=0.4, period=2), Sensor(variance=0.05, range=4.0))},
}


def in_heading_frame(vectors, anchor):
    """Components of vectors (N, 2) along and across the velocity of the anchor (N, 4)."""
    heading = anchor[:, [1, 3]] / np.hypot(anchor[:, 1], anchor[:, 3])[:, None]
    across = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    return (vectors * heading).sum(1), (vectors * across).sum(1)


@pytest.mark.parametrize("options", WORLDS.values(), ids=WORLDS)
def test_twins_have_the_same_episodes_and_every_row_is_in_its_space(options):
    tracks = 11
    envs = [
        HybridTrackVectorEnv(
            tracks,
            tick_info=True,
            observation=name,
            scheme="random 2x5-20",
            **options,
        )
        for name in TWINS
    ]
    results = [env.reset(seed=6) for env in envs]
    infos = [info for _, info in results]
    generator = np.random.default_rng(1)
    episodes = 0
    for _ in range(200):
        for (row, *_), env in zip(results, envs, strict=True):
            assert env.observation_space.contains(row)
        for info in infos[1:]:
            assert info.keys() == infos[0].keys()
            for name, values in info.items():
                np.testing.assert_array_equal(
                    values,
                    infos[0][name],
                    err_msg=name,
                )
        wait = generator.random(tracks) < 0.8
        actions = np.where(
            wait,
            0,
            generator.integers(0, envs[0].single_action_space.n, tracks),
        )
        results = [env.step(actions) for env in envs]
        infos = [result[4] for result in results]
        for _, rewards, terminated, truncated, _ in results:
            np.testing.assert_array_equal(rewards, results[0][1])
            np.testing.assert_array_equal(terminated, results[0][2])
            assert not truncated.any()
        episodes += terminated.sum()

    assert episodes > tracks


@pytest.mark.parametrize("options", WORLDS.values(), ids=WORLDS)
def test_the_layouts_read_the_true_state_and_the_measurement_relative_to_the_anchor(options):
    tracks = 9
    raw, state = (
        HybridTrackVectorEnv(
            tracks,
            tick_info=True,
            observation=name,
            scheme="L12r8 S9",
            **{"radii": 8.0} | options,
        )
        for name in ("raw", "state")
    )
    R = np.exp(np.log(np.broadcast_to(raw.options.variances, 2)).mean())
    raw_layout = RawLayout(raw.options.hypotheses)
    state_layout = StateLayout(state.options.hypotheses)
    (raw_rows, info), (state_rows, _) = raw.reset(seed=2), state.reset(seed=2)
    for tick in range(1, 13):
        anchor = info["anchor"]
        truth = info["truth"]
        places = [0, 2]
        missing = np.isnan(info["measurement"][:, 0])
        along, across = in_heading_frame(
            (info["measurement"] - anchor[:, places]) / np.sqrt(R),
            anchor,
        )
        common = {"ticks": np.full(tracks, tick), "ticks_left": np.full(tracks, 12 - tick)}
        common["log_noise"] = np.full(tracks, np.log(R))
        expected = common | {
            "displacement_along": np.where(missing, 0.0, along),
            "displacement_across": np.where(missing, 0.0, across),
            "measured": 1.0 - missing,
            "speed": np.hypot(anchor[:, 1], anchor[:, 3]),
        }
        assert expected.keys() == raw_layout.slices.keys()
        for name, value in expected.items():
            np.testing.assert_allclose(
                raw_layout.read(raw_rows, name),
                value,
                rtol=1e-5,
                atol=1e-5,
                err_msg=name,
            )

        position = in_heading_frame((truth - anchor)[:, places] / np.sqrt(R), anchor)
        velocity = in_heading_frame(truth[:, [1, 3]], anchor)
        expected = common | {
            "position_along": position[0],
            "position_across": position[1],
            "velocity_along": velocity[0],
            "velocity_across": velocity[1],
            "true_mode": np.eye(state.options.hypotheses)[info["true_mode"]],
        }
        assert expected.keys() == state_layout.slices.keys()
        for name, value in expected.items():
            np.testing.assert_allclose(
                state_layout.read(state_rows, name),
                value,
                rtol=1e-5,
                atol=1e-5,
                err_msg=name,
            )
        wait = np.zeros(tracks, np.int64)
        (raw_rows, *_, info), (state_rows, *_) = raw.step(wait), state.step(wait)

    assert (info["segment"] == 1).all()
