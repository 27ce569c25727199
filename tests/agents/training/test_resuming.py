"""A training that is killed or fails at any moment is resumed, and then equals an uninterrupted one."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import small_training
import torch
from safetensors import safe_open
from small_training import KINDS, log_often, outcome, small_run

from agents.cli import main
from agents.training.checkpoint import CHECKPOINT, PREVIOUS, digest
from agents.training.run_folder import CONFIG, LOCK, METRICS, read_metrics
from agents.training.runs import resume_run
from hybrid_env.checks import ArgumentError

STEPS = 2560
KILLS = 20


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


def interrupt_at(steps):
    def interrupt(progress):
        if progress.steps >= steps:
            raise KeyboardInterrupt

    return interrupt


def interrupted(kind, folder, at, steps=STEPS):
    """A folder of a run that was interrupted; checkpoints after every update."""
    run = small_run(kind, folder, steps)
    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt_at(at), save_every=0.0)
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def start(kind, folder, steps, save_every=0.05):
    """Start a training in another process; return when it begins."""
    line = [sys.executable, small_training.__file__, kind, str(folder), str(steps), str(save_every)]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "training\n"
    return process


def kill(process):
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_equals_an_uninterrupted_one(kind, tmp_path):
    if kind == "recurrent-ppo":
        pytest.importorskip("sb3_contrib")
    small_run(kind, tmp_path / "whole", STEPS).train(save_every=0.0)
    folder = interrupted(kind, tmp_path / "run", STEPS // 2 + 1)
    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002
    resume_run(folder).train(save_every=1000.0)
    assert outcome(folder) == outcome(tmp_path / "whole")
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
        time.sleep(0.1 * generator.random() * (k > 0))  # about one rollout, update and checkpoint
        kill(process)
        resumed += start(kind, folder, steps).communicate()[0] != ""
        assert not list(folder.glob(".*.part*"))
        equal += outcome(folder) == outcome(tmp_path / "whole")
    assert equal == KILLS
    assert resumed > 0.8 * KILLS  # the others were killed after their last checkpoint


def test_a_run_killed_before_its_first_checkpoint_starts_anew(tmp_path):
    small_run("ppo", tmp_path / "whole", 1280).train()
    for again in (lambda folder: small_run("ppo", folder, 1280), resume_run):
        folder = interrupted("ppo", tmp_path / again.__name__, 640, 1280)
        for path in folder.iterdir():
            if path.name not in (CONFIG, LOCK) and not path.name.startswith("events"):
                path.unlink()
        (folder / ".hybridtrack-0.part.safetensors").write_bytes(b"incomplete")
        again(folder).train()
        assert outcome(folder) == outcome(tmp_path / "whole")
        assert not list(folder.glob(".*.part*"))


def test_a_folder_with_results_but_no_checkpoint_is_not_overwritten(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280, 1920)
    for name in (CHECKPOINT, PREVIOUS):
        (folder / name).unlink()
    before = contents(folder)
    for again, name in ((resume_run, "resume"), (lambda one: small_run("ppo", one, 1280), "out")):
        with pytest.raises(ArgumentError, match=f"{name}="):
            again(folder)
    assert contents(folder) == before


def test_a_second_training_in_a_folder_is_refused_until_the_first_is_killed(tmp_path, capsys):
    pytest.importorskip("fcntl")
    folder = tmp_path / "run"
    process = start("ppo", folder, STEPS, save_every=0.0)
    while not (folder / PREVIOUS).exists():
        time.sleep(0.001)
    os.kill(process.pid, signal.SIGSTOP)  # it still has the lock
    assert main(["train", "--resume", str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "other training" in error
    kill(process)
    resume_run(folder).train()
    small_run("ppo", tmp_path / "whole", STEPS).train()
    assert outcome(folder) == outcome(tmp_path / "whole")


def test_a_run_that_another_training_has_continued_is_not_resumed_from_an_earlier_state(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280, 1920)
    first, second = resume_run(folder), resume_run(folder)
    first.train()
    before = contents(folder)
    with pytest.raises(ArgumentError, match="resume="):
        second.train()
    assert contents(folder) == before


def test_a_damaged_checkpoint_is_replaced_by_the_previous_one(tmp_path):
    small_run("sequence", tmp_path / "whole", 1920).train(save_every=0.0)
    folder = interrupted("sequence", tmp_path / "run", 1920, 1920)
    last = (folder / CHECKPOINT).read_bytes()
    (folder / CHECKPOINT).write_bytes(last[: len(last) // 2])
    run = resume_run(folder)
    assert run.num_timesteps == 1152
    run.train()
    assert outcome(folder) == outcome(tmp_path / "whole")


def change(path, edit):
    """Apply a function to the tensors and the text of the values of a checkpoint."""
    with safe_open(path, framework="pt") as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        metadata = file.metadata()
    edit(tensors, metadata)
    if metadata:
        metadata["sha256"] = digest(tensors, metadata["values"])
    safetensors.torch.save_file(tensors, path, metadata)


def replaced(name, value):
    """Edit one tensor: a value for all elements, a function, or None to remove it."""

    def edit(tensors, _):
        if value is None:
            del tensors[name]
        elif callable(value):
            tensors[name] = value(tensors[name])
        else:
            tensors[name] = torch.full_like(tensors[name], value)

    return edit


def rewritten(old, new):
    """Edit the text of the values."""

    def edit(_, metadata):
        assert old in metadata["values"]
        metadata["values"] = metadata["values"].replace(old, new, 1)

    return edit


def test_a_checkpoint_with_a_changed_byte_is_refused(tmp_path):
    folder = interrupted("sequence", tmp_path / "run", 1280, 1920)
    (folder / PREVIOUS).unlink()
    content = bytearray((folder / CHECKPOINT).read_bytes())
    content[-1] ^= 1
    (folder / CHECKPOINT).write_bytes(content)
    with pytest.raises(ArgumentError, match=r"resume=.*is damaged"):
        resume_run(folder)


@pytest.mark.parametrize(("kind", "steps"), [("ppo", 2560), ("sequence", 1920)])
def test_weights_that_diverge_are_not_saved(kind, steps, tmp_path):
    folder = interrupted(kind, tmp_path / "run", 1280)
    change(folder / CHECKPOINT, replaced("optimizer.1.exp_avg", 3e38))
    run = resume_run(folder, steps)
    before = [(folder / name).read_bytes() for name in (CHECKPOINT, "policy.safetensors")]
    with pytest.raises(ArgumentError, match="diverged") as caught:
        run.train(save_every=1000.0)
    assert "\n" not in str(caught.value)
    assert [(folder / name).read_bytes() for name in (CHECKPOINT, "policy.safetensors")] == before


def outside_position(_, metadata):
    values = json.loads(metadata["values"])
    values["random"]["numpy"][1] = 10**6
    metadata["values"] = json.dumps(values)


COMMON = {
    "a moment of another shape": replaced("optimizer.1.exp_avg", lambda old: old[:1].clone()),
    "no moment": replaced("optimizer.0.exp_avg", None),
    "a negative moment": replaced("optimizer.1.exp_avg_sq", -1.0),
    "an infinite moment": replaced("optimizer.1.exp_avg", float("inf")),
    "an unknown tensor": lambda tensors, _: tensors.update(more=torch.zeros(1)),
    "no values": lambda _, metadata: metadata.clear(),
    "values that are not JSON": rewritten("{", ""),
    "deeply nested values": lambda _, metadata: metadata.update(values="[" * 100_000),
    "no steps": rewritten('"steps"', '"step"'),
    "negative steps": rewritten('"steps": ', '"steps": -'),
    "a fraction of a step": rewritten('"steps": ', '"steps": 0.'),
    "infinite seconds": rewritten('"seconds": ', '"seconds": 1e999, "x": '),
}
OF_KIND = {
    "ppo": {
        "weights that are not numbers": replaced("network.action_net.weight", float("nan")),
        "enormous weights": replaced("network.action_net.weight", 1e30),
        "weights of another type": replaced("network.action_net.weight", torch.Tensor.double),
        "a segment that does not exist": replaced("tracks.blocks.segment", 6),
        "a hypothesis that does not exist": replaced("tracks.blocks.active_mode", -1),
        "a segment without end": replaced("tracks.blocks.length", 10**9),
        "no random numbers": replaced("tracks.blocks.random_state", torch.zeros_like),
        "an infinite state": replaced("tracks.hypotheses.x", float("inf")),
        "no returns": replaced("tracks.returns", None),
        "a short state of PyTorch": rewritten('"torch": "', '"torch": "00" , "x": "'),
        "a state that is not hexadecimal": rewritten('"torch": "', '"torch": "xyz'),
        "no state of NumPy": rewritten('"numpy": [[', '"numpy": [[1], 1, 0, 0.0], "x": [['),
        "a position outside the state of NumPy": outside_position,
        "no number of updates": rewritten('"updates"', '"other"'),
        "episodes without ticks": rewritten('"episodes": [', '"episodes": [[1.0],'),
        "an infinite loss": rewritten('"logged": {', '"logged": {"x": Infinity,'),
    },
    "sequence": {
        "weights that are not numbers": replaced("network.score.weight", float("nan")),
        "an infinite hidden state": replaced("tracks.0.hidden_state", float("inf")),
        "a hypothesis that does not exist": replaced("tracks.0.0.blocks.true_mode", 3),
        "no generator": rewritten('"generators": [', '"generators": [], "x": ['),
        "another generator": rewritten("PCG64", "MT19937"),
        "a fraction in a generator": rewritten('"state": {"state": ', '"state": {"state": 0.5, "x": '),
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", OF_KIND)
def test_a_checkpoint_with_wrong_content_is_refused_in_one_line_and_changes_nothing(kind, tmp_path):
    folder = interrupted(kind, tmp_path / "run", 1280, 1920)
    good = (folder / CHECKPOINT).read_bytes()
    for case, edit in (COMMON | OF_KIND[kind]).items():
        for name in (CHECKPOINT, PREVIOUS):
            (folder / name).write_bytes(good)
            change(folder / name, edit)
        before = contents(folder)
        with pytest.raises(ArgumentError, match=r"resume=.*checkpoint") as caught:
            pytest.fail(f"{case} is accepted: {resume_run(folder)}")
        assert "\n" not in str(caught.value), case
        assert contents(folder) == before, case


@pytest.mark.parametrize("length", [0, 7, 8, 500, -1])
def test_a_truncated_checkpoint_is_refused_in_one_line(length, tmp_path):
    folder = tmp_path / "run"
    small_run("ppo", folder, 640).train()
    for name in (CHECKPOINT, PREVIOUS):
        (folder / name).write_bytes((folder / name).read_bytes()[:length])
    before = contents(folder)
    assert main(["train", "--resume", str(folder)]) == 2
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", 1e400), ("seed", "x"), ("seed", -1), ("env", "nothing"), ("options", {"x": 1}), ("options", 3),
     ("recipe", []), ("recipe", {"name": "ppo", "entry": {}})],
)  # fmt: skip
def test_a_config_with_wrong_content_is_refused_in_one_line(name, value, tmp_path, capsys):
    folder = tmp_path / "run"
    small_run("ppo", folder, 640).train()
    config = json.loads((folder / CONFIG).read_text())
    (folder / CONFIG).write_text(json.dumps(config | {name: value}))
    before = contents(folder)
    assert main(["train", "--resume", str(folder)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert contents(folder) == before


@pytest.mark.parametrize("file", [CHECKPOINT, METRICS, "events"])
def test_a_full_disk_is_one_line_and_loses_nothing(file, tmp_path):
    """A limit of the size of files has the effect of a full disk."""
    resource = pytest.importorskip("resource")
    small_run("ppo", tmp_path / "whole", STEPS).train()
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
    assert outcome(folder) == outcome(tmp_path / "whole")


def test_the_metrics_of_a_resumed_run_are_not_repeated(tmp_path):
    folder = interrupted("sequence", tmp_path / "run", STEPS // 2)
    with (folder / METRICS).open("a") as file:
        file.write('{"step": 999999, "loss": 1.0}\n{"step": 1e')
    resume_run(folder).train()
    steps = [row["step"] for row in read_metrics(folder) if "loss" in row]
    assert steps == sorted(set(steps))
    assert steps[-1] <= STEPS + 384


def test_the_folder_of_a_run_can_be_moved(tmp_path):
    folder = interrupted("ppo", tmp_path / "run", 1280, 1920)
    moved = Path(folder.rename(tmp_path / "moved"))
    resume_run(moved).train()
    small_run("ppo", tmp_path / "whole", 1920).train()
    assert outcome(moved) == outcome(tmp_path / "whole")
