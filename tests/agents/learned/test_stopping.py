"""The stopping policy: belief state, training environment, files, and error messages."""

import json
import shutil

import numpy as np
import pytest
import torch

from agents.cli import main
from agents.evaluation.deciders import SHIPPED_FOLDER, load_decider, load_sequence_net
from agents.evaluation.evaluate import evaluate
from agents.learned.sequence import SequenceDecider
from agents.learned.stopping import LOG_PROBABILITY_SCALE, BeliefEncoder
from agents.training.recipe import load_recipe
from agents.training.runs import make_run, resume_run
from agents.training.stopping_vec_env import StoppingVecEnv
from hybrid_env import HybridTrackVectorEnv, WorldOptions

BANK = "hybrid_env:HybridTrackBank-v0"
SMALL = load_recipe(
    "stopping", BANK, ("n_envs=8", "n_steps=32", "batch_size=64", "policy_kwargs.net_arch=[8]")
)


@pytest.mark.parametrize("by_type", [True, False])
def test_the_belief_state_is_that_of_the_sequence_agent(by_type):
    correctness = "type" if by_type else "exact"
    env = HybridTrackVectorEnv(40, radii=(3.0, 5.0, 8.0), correctness=correctness, tick_info=False)
    net = load_sequence_net("shipped")
    encoder, hidden_state, state = BeliefEncoder(net, by_type), None, None
    observation, _ = env.reset(seed=4)
    stopped = 0
    for tick in range(40):
        rows, best, hidden_state = encoder.encode(observation, hidden_state)
        assert rows.shape == (40, encoder.width)
        wrong_type, wrong_radius = np.exp(rows[:, :2].T / LOG_PROBABILITY_SCALE).astype(np.float64)
        error_probability = wrong_type if by_type else wrong_type + (1.0 - wrong_type) * wrong_radius
        decider = SequenceDecider(net, alpha=0.05, radius_weight=0.0 if by_type else 1.0)
        actions, state = decider.predict(observation, state)
        clear = np.abs(error_probability - 0.05) > 1e-5  # farther from the threshold than rounding errors
        np.testing.assert_array_equal(
            np.where(error_probability <= 0.05, best + 1, 0)[clear], actions[clear], err_msg=str(tick)
        )
        stopped += np.count_nonzero(actions)
        observation = env.step(actions)[0]
    assert stopped > 20


@pytest.mark.parametrize("correctness", ["type", "exact"])
def test_the_environment_declares_the_best_hypothesis_and_keeps_the_last_row(correctness):
    options = {"scheme": "random 2x20-30", "radii": (3.0, 5.0), "correctness": correctness}
    net = load_sequence_net("shipped")
    env = StoppingVecEnv(net, BANK, 16, **options)
    plain = HybridTrackVectorEnv(16, autoreset_mode="SameStep", delay_cost=0.01, tick_info=False, **options)
    env.seed(3)
    rows = env.reset()
    observation, _ = plain.reset(seed=3)
    encoder, hidden_state, ended = BeliefEncoder(net, correctness == "type"), None, 0
    generator = np.random.default_rng(0)
    for _ in range(100):
        assert env.observation_space.contains(rows[0])
        expected, best, hidden_state = encoder.encode(observation, hidden_state)
        np.testing.assert_array_equal(rows, expected)
        stop = (generator.random(16) < 0.1).astype(np.int64)
        before = rows
        rows, rewards, ends, infos = env.step(stop)
        observation, wanted, terminated, _, _ = plain.step(np.where(stop == 1, best + 1, 0))
        np.testing.assert_allclose(rewards, wanted, rtol=1e-6)
        np.testing.assert_array_equal(ends, terminated)
        for i in np.flatnonzero(ends):
            np.testing.assert_array_equal(infos[i]["terminal_observation"], before[i])
            ended += 1
    assert ended > 32


def test_a_stopping_policy_is_trained_resumed_and_restored_from_its_folder(tmp_path):
    folder = tmp_path / "run"
    run = make_run(BANK, {}, SMALL, 0, folder, 512)
    before = {name: value.clone() for name, value in run.network.beliefs.state_dict().items()}
    run.train()
    for name, value in run.network.beliefs.state_dict().items():
        assert torch.equal(value, before[name])  # the sequence network is not trained
    resumed = resume_run(folder, 1024)
    resumed.train()
    assert resumed.num_timesteps == 1024
    world = WorldOptions(radii=(4.0,), correctness="type")
    loaded = load_decider(str(folder), world)  # applies to any bank
    observation, _ = HybridTrackVectorEnv(9, radii=(4.0,)).reset(seed=0)
    expected, _ = resumed.decider.predict(observation)
    np.testing.assert_array_equal(loaded.predict(observation)[0], expected)
    high, low = load_decider(f"{folder}:20", world), load_decider(f"{folder}:-20", world)
    assert not high.predict(observation)[0].any()
    assert low.predict(observation)[0].all()
    assert json.loads((folder / "policy.json").read_text())["beliefs_hidden"] == 40


def test_stopping_can_be_learned():
    changes = ("n_envs=48", "n_steps=32", "batch_size=256", "learning_rate=3e-3")
    run = make_run(BANK, {}, load_recipe("stopping", BANK, changes), steps=60_000)
    before = evaluate(run.decider, BANK, episodes=60, seed=9)
    run.train()
    after = evaluate(run.decider, BANK, episodes=60, seed=9)
    gain = after.reward.mean(1) - before.reward.mean(1)  # the same episodes
    assert gain.mean() > 4 * gain.std() / gain.size**0.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ("sequence_agent=3", "sequence_agent=3"),
        ("sequence_agent=nowhere", "sequence_agent='nowhere'"),
        ("observe=[posterior]", "observe=('posterior',)"),
        ("algo=recurrent_ppo policy=MlpLstmPolicy", "a recurrent policy"),
    ],
)
def test_invalid_sequence_agents_are_refused_in_one_line(changes, words, capsys):
    line = f"train --recipe stopping --env HybridTrackBank-v0 --steps 64 --set {changes}"
    assert main(line.split()) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_run_folder_without_a_sequence_agent_is_refused(tmp_path, capsys):
    folder = str(tmp_path / "ppo")
    small = ["n_envs=8", "n_steps=32", "batch_size=64"]
    assert main(["train", "--out", folder, "--steps", "256", "--set", *small]) == 0
    line = f"train --recipe stopping --env HybridTrackBank-v0 --out {tmp_path / 'next'} "
    line += f"--set sequence_agent={folder}"
    assert main(line.split()) == 2
    assert "sequence agent" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "next").exists()


def test_a_run_is_resumed_without_the_folder_of_its_sequence_agent(tmp_path):
    folder, source = tmp_path / "run", tmp_path / "sequence"
    shutil.copytree(SHIPPED_FOLDER, source)
    recipe = load_recipe(
        "stopping", BANK, ("n_envs=8", "n_steps=32", "batch_size=64", f"sequence_agent={source}")
    )
    make_run(BANK, {}, recipe, 0, folder, 256).train()
    shutil.rmtree(source)
    resumed = resume_run(folder, 512)
    resumed.train()
    assert resumed.num_timesteps == 512
    for name, value in load_sequence_net("shipped").state_dict().items():
        assert torch.equal(resumed.network.beliefs.state_dict()[name], value)
