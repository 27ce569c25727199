"""What every registered algorithm promises: a run is reproducible, is resumed with equal results,
and its folder holds the agent that it has trained.
"""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import small_training
import torch
from small_training import (
    KINDS,
    STEPS,
    assert_folder_decides_as,
    interrupted,
    log_often,
    outcome,
    whole_runs,
)

from agents.learned.algorithm_names import algorithm_names
from agents.training.checkpoint import CHECKPOINT, read_checkpoint, write_checkpoint
from agents.training.recipe import load_recipe
from agents.training.run_folder import CONFIG, read_metrics
from agents.training.runs import resume_run
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
KILLS = 6
ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return whole_runs(tmp_path_factory.mktemp("whole"))


def start(kind, folder, steps, save_every=0.05):
    """Start a training in another process; return when it begins."""
    # -P, because the folder of the script has a subfolder named as the package `agents`.
    line = [sys.executable, "-P", small_training.__file__, kind, folder, steps, save_every]
    folders = [ROOT, ROOT / "tests"]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
    process = subprocess.Popen([*map(str, line)], stdout=subprocess.PIPE, text=True, env=env)
    assert process.stdout.readline() == "training\n"
    return process


def kill(process):
    process.kill()
    process.wait()
    process.stdout.close()


def test_every_algorithm_of_the_package_is_tested():
    assert {load_recipe(KINDS[kind][0], ENV).algo for kind in KINDS} >= set(algorithm_names())


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_equals_an_uninterrupted_one(kind, whole, tmp_path):
    folder = interrupted(kind, tmp_path / "run", STEPS // 2 + 1)
    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002
    resume_run(folder).train(save_every=1000.0)

    assert outcome(folder) == outcome(whole(kind).folder)
    steps = [row["step"] for row in read_metrics(folder) if "evaluation/reward" in row]
    assert len(steps) == len(set(steps)) >= 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_folder_has_card_metrics_and_an_equivalent_decider(kind, whole):
    run = whole(kind)
    card = json.loads((run.folder / "policy.json").read_text())
    recipe, env, options, _ = KINDS[kind]

    assert card["environment"] == f"hybrid_env:{env}"
    name = Path(recipe).stem
    assert (card["options"], card["recipe"]["name"], card["seed"]) == (options, name, 3)
    assert_folder_decides_as(run, options)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["ppo", "network"])
def test_a_run_killed_at_random_moments_equals_an_uninterrupted_one(kind, tmp_path):
    steps = 5 * STEPS
    output, _ = start(kind, tmp_path / "whole", steps).communicate()
    rollouts = len(output.splitlines())
    generator = np.random.default_rng(17)
    resumed = 0
    for k, rollout in enumerate([0, *generator.integers(rollouts, size=KILLS - 1)]):
        folder = tmp_path / str(k)
        process = start(kind, folder, steps)
        for _ in range(rollout):
            process.stdout.readline()
        # About one rollout, update and checkpoint.
        time.sleep(0.1 * generator.random() * (k > 0))
        kill(process)
        resumed += start(kind, folder, steps).communicate()[0] != ""
        assert not list(folder.glob(".*.part*"))
        assert outcome(folder) == outcome(tmp_path / "whole")

    # The others were killed after their last checkpoint.
    assert resumed > 0.8 * KILLS


def test_a_run_killed_before_its_first_checkpoint_starts_anew(whole, tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 640)
    for path in {*folder.iterdir()} - {folder / CONFIG, folder / ".training.lock"}:
        path.unlink()
    (folder / ".hybridtrack-0.part.pt").write_bytes(b"incomplete")
    resume_run(folder).train()

    assert outcome(folder) == outcome(whole("ppo").folder)
    assert not list(folder.glob(".*.part*"))


def test_a_second_training_in_a_folder_is_refused(tmp_path):
    pytest.importorskip("fcntl")
    folder = tmp_path / "run"
    process = start("ppo", folder, STEPS, save_every=0.0)
    process.stdout.readline()
    # It still has the lock.
    os.kill(process.pid, signal.SIGSTOP)

    with pytest.raises(ArgumentError, match="other training"):
        resume_run(folder).train()
    kill(process)


def test_a_damaged_checkpoint_or_one_with_code_is_refused_in_one_line(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280)
    content = (folder / CHECKPOINT).read_bytes()
    with zipfile.ZipFile(folder / CHECKPOINT) as file:
        largest = max(file.infolist(), key=lambda part: part.file_size)
        place = content.index(file.read(largest))
    changed = content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
    state = read_checkpoint(folder)
    state["tracks"]["blocks.true_mode"][:] = 99
    write_checkpoint(folder, state)
    outside = (folder / CHECKPOINT).read_bytes()
    for damaged in (content[:place], changed, outside, b"", pickle.dumps(os.getcwd)):
        (folder / CHECKPOINT).write_bytes(damaged)
        with pytest.raises(ArgumentError, match=r"resume=.*checkpoint"):
            resume_run(folder)
    # Sparse: it needs no space.
    os.truncate(folder / CHECKPOINT, 2**40)
    with pytest.raises(ArgumentError, match="larger than 536,870,912 bytes"):
        resume_run(folder)


def test_weights_that_diverge_are_not_saved(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280)
    state = read_checkpoint(folder)
    state["optimizer"]["state"][1]["exp_avg"][:] = 3e38
    write_checkpoint(folder, state)
    before = (folder / "policy.safetensors").read_bytes()
    with pytest.raises(ArgumentError, match="diverged"):
        resume_run(folder).train(save_every=1000.0)

    assert (folder / "policy.safetensors").read_bytes() == before
