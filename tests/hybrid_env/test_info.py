"""The info of the vector environments: plain dictionaries, with the keys of Gymnasium's own
vectorizers.
"""

import copy
import pickle

import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
)

TRACKS = 3
KINDS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "random 2x5-9", "radii": (3.0, 5.0)},
    ),
    "evidence": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {
            "scheme": "random 2x5-9",
            "bank": "anchor_aware",
            "evidence": 0.6,
        },
    ),
    "filters": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "random 2x5-9", "bank_info": True},
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, {"ticks": 15}),
    "drawn": (
        HybridTrackQuickestVectorEnv,
        HybridTrackQuickestEnv,
        {"ticks": 15, "durations": "drawn"},
    ),
}
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]
AT_ENDS = {"final_obs", "_final_obs", "final_info", "_final_info"}


def play(env, steps=120, seed=3):
    """Yield the info of the reset and of every step with random actions."""
    generator = np.random.default_rng(0)
    yield env.reset(seed=seed)[1]
    count = env.single_action_space.n
    for _ in range(steps):
        yield env.step(
            np.where(
                generator.random(TRACKS) < 0.3,
                generator.integers(0, count, TRACKS),
                0,
            )
        )[4]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tick_info", [True, False])
def test_info_is_a_plain_dictionary_with_the_mask_of_the_actions_in_every_step(
    kind,
    mode,
    tick_info,
):
    vector, _, options = KINDS[kind]
    env = vector(TRACKS, autoreset_mode=mode, tick_info=tick_info, **options)
    for info in play(env):
        assert type(info) is dict
        assert type(info.get("final_info", {})) is dict
        assert info["action_mask"].dtype == np.int8
        assert info["action_mask"].shape == (TRACKS, env.single_action_space.n)
        assert info["_action_mask"].all()
        np.testing.assert_array_equal(env.action_masks(), info["action_mask"] == 1)
        for again in (copy.deepcopy(info), pickle.loads(pickle.dumps(info))):
            assert type(again) is dict
            assert again.keys() == info.keys()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
def test_a_described_tick_has_the_same_keys_from_reset_and_from_every_step(kind, mode):
    vector, _, options = KINDS[kind]
    infos = list(play(vector(TRACKS, autoreset_mode=mode, tick_info=True, **options)))

    assert {frozenset(info.keys() - AT_ENDS) for info in infos} == {frozenset(infos[0])}
    ended = sum("final_info" in info for info in infos)
    assert (ended > 0) == (mode is AutoresetMode.SAME_STEP)


@pytest.mark.parametrize("kind", KINDS)
def test_without_the_description_the_keys_are_those_of_the_mask_and_of_what_happened(kind):
    vector, _, options = KINDS[kind]
    described, short = (
        list(play(vector(TRACKS, tick_info=one, **options))) for one in (True, False)
    )
    for info, expected in zip(short, described, strict=True):
        assert {"action_mask", "_action_mask"} <= info.keys() <= expected.keys()
        for name, values in info.items():
            np.testing.assert_array_equal(values, expected[name], err_msg=name)
        decided = expected.get("_ticks", np.zeros(TRACKS, bool)).any()
        assert not decided or "decided_mode" in info
        assert "tick" not in info


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
def test_info_is_equivalent_to_that_of_a_sync_vector_env(kind, mode):
    vector, single, options = KINDS[kind]
    ours = vector(TRACKS, autoreset_mode=mode, tick_info=True, **options)
    theirs = SyncVectorEnv([lambda: single(**options)] * TRACKS, autoreset_mode=mode)
    for mine, other in zip(play(ours), play(theirs), strict=True):
        compare(mine, other)


def compare(mine, other):
    """Compare two infos where the masks of the second one are True; the masks of other keys are
    False.
    """
    for name in {name for name in mine.keys() | other.keys() if not name.startswith("_")}:
        if name not in other:
            assert not mine[f"_{name}"].any()
            continue
        mask = other[f"_{name}"]
        assert data_equivalence(mine[f"_{name}"], mask)
        if name == "final_info":
            compare(mine[name], other[name])
        else:
            assert data_equivalence(
                mine[name][mask],
                other[name][mask],
                exact=name != "final_obs",
            ), name


@pytest.mark.parametrize("mode", MODES)
def test_info_that_is_kept_does_not_change_in_later_steps(mode):
    env = HybridTrackVectorEnv(
        TRACKS,
        autoreset_mode=mode,
        tick_info=True,
        bank_info=True,
        scheme="random 2x5-9",
    )
    kept = []
    copies = []
    for info in play(env, 60):
        kept.append(info)
        copies.append(pickle.loads(pickle.dumps(info)))
    for info, expected in zip(kept, copies, strict=True):
        for name in info.keys() - AT_ENDS:
            np.testing.assert_array_equal(info[name], expected[name], err_msg=name)
