"""The page of an episode: what it shows at a tick, and that a browser draws it."""

import json

import gymnasium as gym
import numpy as np
import pytest
from scipy.special import softmax

from agents.commands.play import Play
from agents.evaluation.registry import load_decider
from baselines import record_statements
from baselines.rules.rollout import record_decisions
from hybrid_env.checks import ArgumentError

DECLARED, STATED = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
SELDOM = "hybrid_env:HybridTrack-v0"
OPTIONS = {
    DECLARED: {"scheme": "S20 L25r5 S20"},
    # Asked every few ticks.
    SELDOM: {"scheme": "S20 L25r5 S20"},
    STATED: {"ticks": 60, "durations": "uniform 15-20"},
}
DECIDERS = {
    DECLARED: ("sprt", "fixed:5"),
    SELDOM: ("shipped", "msprt"),
    STATED: ("threshold", "threshold:0.4"),
}
SEED = 3


def written(folder, env_id, deciders=()):
    path = folder / "episode.html"
    Play(env=env_id, deciders=deciders, seed=SEED, out=path, **OPTIONS[env_id]).run()
    return path


def data_of(path):
    text = path.read_text("utf-8").split("const episode = ", 1)[1]
    return json.JSONDecoder().raw_decode(text)[0]


@pytest.mark.parametrize("env_id", DECIDERS)
def test_the_page_shows_what_is_evaluated_and_the_posteriors(tmp_path, env_id):
    episode = data_of(written(tmp_path, env_id, DECIDERS[env_id]))
    assert [row["name"] for row in episode["deciders"]] == list(DECIDERS[env_id])
    env = gym.make(env_id, **OPTIONS[env_id])
    _, info = env.reset(seed=SEED)
    for tick in range(0 if env_id == SELDOM else 4):
        logs = info["log_likelihood" if env_id == DECLARED else "log_probability"]
        for row in episode["deciders"]:
            shown = [curve[tick] for curve in row["posteriors"]]
            assert shown == pytest.approx(softmax(logs), abs=1e-4)
        *_, info = env.step(0)
    for row in episode["deciders"]:
        decider, marks = load_decider(row["name"], env.unwrapped.options), row["marks"]
        if env_id != STATED:
            expected = record_decisions(decider, env_id, 1, SEED, **OPTIONS[env_id])
            for name, values in (("right", expected.correct), ("delays", expected.ticks)):
                assert [row[name][mark] for mark in marks] == values[0].tolist()
            assert len(row["modes"]) == expected.length.sum()
            assert row["rewards"][-1] == pytest.approx(expected.reward.sum())
        else:
            expected = record_statements(decider, 1, SEED, **OPTIONS[env_id])
            modes = expected.stated_modes[:, 0]
            assert row["modes"] == modes.tolist()
            assert marks == (np.flatnonzero(np.diff(modes)) + 1).tolist()
            assert row["right"] == (modes == expected.true_modes[:, 0]).tolist()


def test_several_deciders_need_a_page(tmp_path):
    with pytest.raises(ArgumentError, match=r"deciders=.*FILE\.html"):
        Play(deciders=("ate", "sprt"), out=tmp_path / "episode.png").run()
