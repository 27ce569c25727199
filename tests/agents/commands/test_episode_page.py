"""The page of an episode: what it shows at a tick, and that a browser draws it."""

import json

import gymnasium as gym
import numpy as np
import pytest
from scipy.special import softmax

from agents.commands.play import Play
from agents.evaluation.registry import load_decider
from hybrid_env.checks import ArgumentError

DECLARED, STATED = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
OPTIONS = {
    DECLARED: {"scheme": "S20 L25r5 S20"},
    STATED: {"ticks": 60, "durations": "uniform 15-20"},
}
DECIDERS = {DECLARED: ("sprt", "fixed:5"), STATED: ("threshold", "threshold:0.4")}
SEED = 3


def written(folder, env_id, deciders=()):
    path = folder / "episode.html"
    Play(env=env_id, deciders=deciders, seed=SEED, out=path, **OPTIONS[env_id]).run()
    return path


def data_of(path):
    text = path.read_text("utf-8").split("const episode = ", 1)[1]
    return json.JSONDecoder().raw_decode(text)[0]


def stepped(env_id, name):
    """Posterior and reward of each tick by hand; decisions (tick, mode, right, delay), with
    unknown switches the changes of the statement without right and delay.
    """
    env = gym.make(env_id, **OPTIONS[env_id])
    decider = load_decider(name, env.unwrapped.options)
    declared = env_id == DECLARED
    row, info = env.reset(seed=SEED)
    state, start, ended = None, True, False
    tick, length, stated = 1, 0, None
    posteriors, rewards, decisions = {}, {}, []
    while not ended:
        posteriors[tick] = (
            softmax(info["log_likelihood"]) if declared else np.exp(info["log_probability"])
        )
        action, state = decider.predict(row[None], state, np.array([start]))
        row, rewards[tick], ended, _, info = env.step(int(action[0]))
        if not declared:
            if stated not in (None, int(action[0])):
                decisions.append((tick, int(action[0])))
            stated = int(action[0])
            tick += 1
        elif "correct" in info:
            mode, right, delay = (info[key] for key in ("decided_mode", "correct", "ticks"))
            decisions.append((tick, mode, right, delay))
            length += info["decided_length"]
            tick = length + 1
        else:
            tick += 1
        start = False
    return posteriors, rewards, decisions


@pytest.mark.parametrize("env_id", [DECLARED, STATED])
def test_the_page_shows_at_every_tick_what_a_rollout_has_there(tmp_path, env_id):
    episode = data_of(written(tmp_path, env_id, DECIDERS[env_id]))
    length = len(episode["modes"])
    assert [row["name"] for row in episode["deciders"]] == list(DECIDERS[env_id])
    for row in episode["deciders"]:
        posteriors, rewards, decisions = stepped(env_id, row["name"])
        for tick in range(1, length + 1):
            shown = [curve[tick - 1] for curve in row["posteriors"]]
            if tick in posteriors:
                assert shown == pytest.approx(posteriors[tick], abs=1e-4)
            else:
                assert shown == [None] * len(episode["names"])
            so_far = sum(reward for at, reward in rewards.items() if at <= tick)
            assert row["rewards"][tick - 1] == pytest.approx(so_far)
        assert decisions
        assert [mark + 1 for mark in row["marks"]] == [decision[0] for decision in decisions]
        for at, mode, *outcome in decisions:
            assert row["modes"][at - 1] == mode
            if outcome:
                assert [row["right"][at - 1], row["delays"][at - 1]] == outcome


def test_several_deciders_need_a_page(tmp_path):
    with pytest.raises(ArgumentError, match=r"deciders=.*FILE\.html"):
        Play(deciders=("ate", "sprt"), out=tmp_path / "episode.png").run()
