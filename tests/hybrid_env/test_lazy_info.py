"""An info dictionary that is filled on first access behaves like an ordinary dictionary."""

import copy
import pickle

import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv
from hybrid_env.vector_env import LazyInfo


def lazy(calls, further=()):
    def make():
        calls.append(1)
        return {"tick": np.array([3, 4])}

    return LazyInfo(make, dict(further))


USES = {
    "getitem": lambda info: info["tick"], "get": lambda info: info.get("tick"), "in": lambda info: "tick" in info,
    "len": len, "iterate": list, "keys": lambda info: info.keys(), "items": lambda info: info.items(), "repr": repr,
    "or": lambda info: info | {"x": 1}, "reverse or": lambda info: {"x": 1} | info, "dict": dict,
    "unpack": lambda info: {**info}, "keywords": lambda info: dict(**info), "copy": lambda info: info.copy(),
    "deepcopy": copy.deepcopy, "pickle": pickle.dumps, "set": lambda info: info.update(episode=1),
    "pop": lambda info: info.pop("tick"),
}  # fmt: skip


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_every_access_fills_the_dictionary_once(use):
    calls = []
    info = lazy(calls)
    assert calls == []
    use(info)
    assert calls == [1]
    assert len(info) in (1, 2, 3)
    assert calls == [1]


def test_info_read_later_equals_that_of_single_environments():
    envs, singles = HybridTrackVectorEnv(10), [HybridTrackEnv() for _ in range(10)]
    envs.reset(seed=5)
    for i, single in enumerate(singles):
        single.reset(seed=5 + i)
    kept = []
    for k in range(30):
        action = {10: 1, 20: 2}.get(k, 0)
        info = envs.step(np.full(10, action))[4]
        kept.append((info, [single.step(action)[4] for single in singles]))
    for info, expected in kept:  # first access
        for i, one in enumerate(expected):
            for key, value in one.items():
                np.testing.assert_array_equal(info[key][i], value)
                assert info[f"_{key}"][i]
