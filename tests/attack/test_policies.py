"""Random files of policies and recipes: each is refused in one line, or its policy decides."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hostile_input import accepted, attack, counts, damaged
from hostile_policies import OPTIONS, actor_weights, stored, value_weights, write_zip
from hypothesis import strategies as st

from agents.evaluation.registry import find_decider

NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf, 1e30, -1e7, 0.0])
SIZES = st.sampled_from([0, 1, 4, 8, 29, 2000, 10**5, 10**9])
TYPES = [torch.bfloat16, torch.float64, torch.int64, torch.bool, torch.complex64]
SEEN = np.zeros((3, 29), np.float32)


@st.composite
def changed_weights(draw):
    """Weights with other numbers, types, strides, shapes, names, or more layers."""
    weights = draw(st.sampled_from([actor_weights, value_weights]))()
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(weights)))
        change = draw(st.sampled_from(["number", "type", "strides", "layers", "sparse", "name"]))
        shape = weights[name].shape
        small = shape.numel() < 10**6
        if change == "number" and small:
            weights[name] = torch.full(shape, draw(NUMBERS))
        elif change == "type" and small:
            weights[name] = torch.zeros(shape).to(draw(st.sampled_from(TYPES)))
        elif change == "strides":
            weights[name] = torch.zeros(1).expand(draw(SIZES), min(draw(SIZES), 10**6))
        elif change == "layers":
            net = draw(st.sampled_from(["mlp_extractor.policy_net", "q_net.q_net"]))
            units = draw(st.integers(0, 2000))
            layers = range(draw(st.integers(1, 150)))
            weights |= {f"{net}.{2 * k}.bias": torch.zeros(units) for k in layers}
        elif change == "sparse" and small:
            weights[name] = torch.zeros(shape).to_sparse()
        elif change == "name":
            weights[draw(st.text(max_size=200))] = weights[name]
    return stored(weights)


def decide(path):
    """Let the policy of a file decide, or check its refusal."""
    decider = accepted(lambda: find_decider(str(path), OPTIONS))
    if decider is not None:
        actions, _ = decider.predict(SEEN)
        assert np.shape(actions) == (len(SEEN),)


def use_zip(content):
    with tempfile.TemporaryDirectory() as folder:
        decide(write_zip(Path(folder) / "model.zip", content))


def use_bytes(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.zip"
        path.write_bytes(content)
        decide(path)


def any_zip():
    """Content of a sound zip file."""
    with tempfile.TemporaryDirectory() as folder:
        return write_zip(Path(folder) / "model.zip", actor_weights()).read_bytes()


KINDS = {
    "weights": (use_zip, changed_weights),
    "damaged zip": (use_bytes, lambda: damaged(any_zip())),
}


@pytest.mark.parametrize("examples", counts(20, 4_000))
@pytest.mark.parametrize("kind", KINDS)
def test_a_random_policy_is_refused_in_one_line_or_decides(kind, examples, tmp_path):
    use, values = KINDS[kind]
    write_zip(tmp_path / "model.zip", actor_weights())
    find_decider(str(tmp_path / "model.zip"), OPTIONS)
    attack(examples, values(), use)
