"""Policies of other libraries that are broken or hostile are refused in one line, in little time
and memory.
"""

import pickle
import sys
import zipfile

import gymnasium as gym
import numpy as np
import pytest
import torch
from hostile_input import accepted, attack, counts, damaged, refused
from hostile_policies import ENV, HOSTILE_ZIPS, OPTIONS, WIDTH, actor_weights, rows, write_zip
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from agents.evaluation.registry import find_decider
from agents.interface.world_arguments import TRUST


@pytest.mark.parametrize("kind", HOSTILE_ZIPS)
def test_a_hostile_zip_is_refused_in_one_line(kind, tmp_path):
    content, data = HOSTILE_ZIPS[kind]()
    path = write_zip(tmp_path / "model.zip", content, data, zipfile.ZIP_DEFLATED)
    find_decider(str(write_zip(tmp_path / "sound.zip", actor_weights())), OPTIONS)

    assert accepted(lambda: refused(find_decider, str(path), OPTIONS)).startswith(
        ("decider=", "model.zip: ")
    )


@pytest.mark.parametrize("examples", counts(20, 4_000))
def test_a_damaged_zip_is_refused_in_one_line_or_decides(examples, tmp_path):
    path = write_zip(tmp_path / "model.zip", actor_weights())
    find_decider(str(path), OPTIONS)

    def use(content):
        path.write_bytes(content)
        decider = accepted(lambda: find_decider(str(path), OPTIONS))
        if decider is not None:
            assert np.shape(decider.predict(np.zeros((3, WIDTH), np.float32))[0]) == (3,)

    attack(examples, damaged(path.read_bytes()), use)


@pytest.fixture(scope="module")
def trained():
    """A model trained on normalised observations, and the statistics."""
    torch.set_num_threads(1)
    env = VecNormalize(DummyVecEnv([lambda: gym.make(ENV)]))
    return PPO("MlpPolicy", env, seed=1, n_steps=16, batch_size=16).learn(32), env


def test_statistics_beside_a_trusted_model_normalise_its_rows(tmp_path, monkeypatch, trained):
    model, env = trained
    path = tmp_path / "rl_model_32_steps.zip"
    model.save(path)
    env.save(str(tmp_path / "rl_model_vecnormalize_32_steps.pkl"))
    with pytest.warns(UserWarning, match="was trained on normalised observations.*--trust"):
        find_decider(str(path), OPTIONS)
    monkeypatch.setenv(TRUST, "1")
    decider = find_decider(str(path), OPTIONS)
    for seen in rows(4):
        expected, _ = model.predict(env.normalize_obs(seen), deterministic=True)
        np.testing.assert_array_equal(decider.predict(seen)[0], expected)


def test_nothing_is_unpickled_without_trust(tmp_path, trained):
    class Evil:
        def __reduce__(self):
            return sys.exit, (3,)

    trained[0].save(tmp_path / "model.zip")
    (tmp_path / "vecnormalize.pkl").write_bytes(pickle.dumps(Evil()))
    with pytest.warns(UserWarning, match="--trust"):
        find_decider(str(tmp_path / "model.zip"), OPTIONS)
