"""Damaged or wrong files of a run are refused in one line, and nothing is lost."""

import json
import os

import pytest
import safetensors.torch
import torch
from safetensors import safe_open
from small_training import contents, interrupted, log_often, outcome, small_run

from agents.training.checkpoint import CHECKPOINT, PREVIOUS, digest
from agents.training.runs import resume_run
from hybrid_env.checks import ArgumentError


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


def test_a_damaged_checkpoint_is_replaced_by_the_previous_one(tmp_path):
    small_run("anchor", tmp_path / "whole", 1920).train(save_every=0.0)
    folder = interrupted("anchor", tmp_path / "run", 1920, 1920)
    last = (folder / CHECKPOINT).read_bytes()
    (folder / CHECKPOINT).write_bytes(last[: len(last) // 2])
    run = resume_run(folder)

    assert run.num_timesteps == 1152
    run.train()
    assert outcome(folder) == outcome(tmp_path / "whole")


def test_a_checkpoint_of_another_size_is_not_read_into_memory(tmp_path):
    folder = interrupted("anchor", tmp_path / "run", 1920, 1920)
    for name in (CHECKPOINT, PREVIOUS):
        # Sparse: it needs no space.
        os.truncate(folder / name, 2**40)
    with pytest.raises(ArgumentError, match="larger than 536,870,912 bytes"):
        resume_run(folder)


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
    folder = interrupted("anchor", tmp_path / "run", 1280, 1920)
    (folder / PREVIOUS).unlink()
    content = bytearray((folder / CHECKPOINT).read_bytes())
    content[-1] ^= 1
    (folder / CHECKPOINT).write_bytes(content)
    with pytest.raises(ArgumentError, match=r"resume=.*is damaged"):
        resume_run(folder)


@pytest.mark.parametrize(
    ("kind", "steps"),
    [
        ("ppo", 2560),
        ("anchor", 1920),
    ],
)
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
    "deeply nested values": lambda _, metadata: metadata.update(values="[" * 100_000),
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
        "a state that is not hexadecimal": rewritten('"torch": "', '"torch": "xyz'),
        "no state of NumPy": rewritten('"numpy": [[', '"numpy": [[1], 1, 0, 0.0], "x": [['),
        "a position outside the state of NumPy": outside_position,
    },
    "anchor": {
        "weights that are not numbers": replaced("network.anchor.output.weight", float("nan")),
        "an infinite error": replaced("tracks.0.errors", float("inf")),
        "a hypothesis that does not exist": replaced("tracks.0.0.blocks.true_mode", 3),
        "no generator": rewritten('"generators": [', '"generators": [], "x": ['),
        "another generator": rewritten("PCG64", "MT19937"),
    },
}


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
