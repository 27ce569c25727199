"""A training that is killed or fails at any moment is resumed, and then equals an uninterrupted
one.
"""

import errno
import functools
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import small_training
import torch
from small_training import KINDS, STEPS, contents, interrupted, log_often, outcome, small_run

from agents.cli import main
from agents.training.checkpoint import CHECKPOINT, PREVIOUS
from agents.training.run_folder import CONFIG, LOCK, METRICS, read_metrics
from agents.training.runs import resume_run
from hybrid_env.checks import ArgumentError

KILLS = 20


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The outcome of an uninterrupted training, made once for each kind and number of steps."""

    @functools.cache
    def outcome_of(kind="ppo", steps=STEPS):
        folder = tmp_path_factory.mktemp("whole")
        small_run(kind, folder, steps).train()
        return outcome(folder)

    return outcome_of


def start(kind, folder, steps, save_every=0.05):
    """Start a training in another process; return when it begins."""
    # -P, because the folder of the script has a subfolder named as the package `agents`.
    line = [
        sys.executable,
        "-P",
        small_training.__file__,
        kind,
        str(folder),
        str(steps),
        str(save_every),
    ]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "training\n"
    return process


def kill(process):
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_equals_an_uninterrupted_one(kind, whole, tmp_path):
    if kind in ("recurrent-ppo", "qrdqn"):
        pytest.importorskip("sb3_contrib")
    folder = interrupted(kind, tmp_path / "run", STEPS // 2 + 1)
    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002
    resume_run(folder).train(save_every=1000.0)

    assert outcome(folder) == whole(kind)
    steps = [row["step"] for row in read_metrics(folder) if "evaluation/reward" in row]
    assert len(steps) == len(set(steps)) >= 3


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_a_run_killed_at_random_moments_equals_an_uninterrupted_one(kind, tmp_path):
    steps = 5 * STEPS
    whole, _ = start(kind, tmp_path / "whole", steps).communicate()
    rollouts = len(whole.splitlines())
    generator = np.random.default_rng(17)
    equal = resumed = 0
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
        equal += outcome(folder) == outcome(tmp_path / "whole")

    assert equal == KILLS
    # The others were killed after their last checkpoint.
    assert resumed > 0.8 * KILLS


def test_a_run_killed_before_its_first_checkpoint_starts_anew(whole, tmp_path):
    for again in (lambda folder: small_run("ppo", folder, 1280), resume_run):
        folder = interrupted("ppo", tmp_path / again.__name__, 640, 1280)
        for path in folder.iterdir():
            if path.name not in (CONFIG, LOCK) and not path.name.startswith("events"):
                path.unlink()
        (folder / ".hybridtrack-0.part.safetensors").write_bytes(b"incomplete")
        again(folder).train()
        assert outcome(folder) == whole(steps=1280)
        assert not list(folder.glob(".*.part*"))


def test_a_folder_with_results_but_no_checkpoint_is_not_overwritten(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280, 1920)
    for name in (CHECKPOINT, PREVIOUS):
        (folder / name).unlink()
    before = contents(folder)
    for again, name in (
        (resume_run, "resume"),
        (lambda one: small_run("ppo", one, 1280), "out"),
    ):
        with pytest.raises(ArgumentError, match=f"{name}="):
            again(folder)

    assert contents(folder) == before


def test_a_second_training_in_a_folder_is_refused_until_the_first_is_killed(
    whole,
    tmp_path,
    capsys,
):
    pytest.importorskip("fcntl")
    folder = tmp_path / "run"
    process = start("ppo", folder, STEPS, save_every=0.0)
    while not (folder / PREVIOUS).exists():
        time.sleep(0.001)
    # It still has the lock.
    os.kill(process.pid, signal.SIGSTOP)

    assert main(["train", "--resume", str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "other training" in error
    kill(process)
    resume_run(folder).train()
    assert outcome(folder) == whole()


def test_a_run_that_another_training_has_continued_is_not_resumed_from_an_earlier_state(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280, 1920)
    first = resume_run(folder)
    second = resume_run(folder)
    first.train()
    before = contents(folder)
    with pytest.raises(ArgumentError, match="resume="):
        second.train()

    assert contents(folder) == before


@pytest.mark.parametrize("file", [CHECKPOINT, METRICS, "events"])
def test_a_full_disk_is_one_line_and_loses_nothing(file, whole, tmp_path):
    """A limit of the size of files has the effect of a full disk."""
    resource = pytest.importorskip("resource")
    folder = tmp_path / "run"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(progress):
        if progress.steps >= STEPS // 2:
            path = next(folder.glob(f"{file}*"))
            resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size // 2, hard))

    run = small_run("ppo", folder, STEPS)
    if file == "events":
        run_folder_metrics = pytest.MonkeyPatch()
        run_folder_metrics.setattr("agents.training.run_folder.append_metrics", lambda *_: None)
    try:
        with pytest.raises(ArgumentError, match=r"can be written \(File too large\)$") as caught:
            run.train(fill, save_every=0.0 if file == CHECKPOINT else 1000.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        if file == "events":
            run_folder_metrics.undo()

    assert "\n" not in str(caught.value)
    assert not list(folder.glob(".*.part*"))
    if (folder / METRICS).exists():
        assert (folder / METRICS).read_text().endswith("}\n")
    resume_run(folder).train()
    assert outcome(folder) == whole()


def test_a_disk_that_is_full_from_the_start_is_one_line(tmp_path, monkeypatch, capsys):
    """TensorBoard writes in a thread, whose error must not be printed."""

    def refuse(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    failed = threading.Event()
    hook = threading.excepthook
    monkeypatch.setattr(threading, "excepthook", lambda error: (failed.set(), hook(error)))
    monkeypatch.setattr("tensorboard.summary.writer.record_writer.RecordWriter.write", refuse)
    with pytest.raises((ArgumentError, OSError), match="No space left on device"):
        small_run("ppo", tmp_path / "run", STEPS).train()

    assert not failed.is_set()
    assert capsys.readouterr().err == ""


def test_the_metrics_of_a_resumed_run_are_not_repeated(tmp_path):
    folder = interrupted("anchor", tmp_path / "run", STEPS // 2)
    with (folder / METRICS).open("a") as file:
        file.write('{"step": 999999, "loss": 1.0}\n{"step": 1e')
    resume_run(folder).train()
    steps = [row["step"] for row in read_metrics(folder) if "anchor_loss" in row]

    assert steps == sorted(set(steps))
    assert steps[-1] <= STEPS + 384
