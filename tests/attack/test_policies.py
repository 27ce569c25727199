"""Random files of policies and recipes: each is refused in one line, or its policy decides."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hostile_input import accepted, attack, counts, damaged
from hostile_policies import (
    ACTIONS,
    OPTIONS,
    actor_weights,
    network,
    node,
    stored,
    value_weights,
    write_onnx,
    write_zip,
)
from hypothesis import strategies as st

from agents.evaluation.registry import find_decider
from agents.interface.input_files import parse_yaml
from hybrid_env.checks import ArgumentError, reject

NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf, 1e30, -1e7, 0.0])
SIZES = st.sampled_from([0, 1, 4, 8, 28, 2000, 10**5, 10**9])
TYPES = [
    torch.float16,
    torch.bfloat16,
    torch.float32,
    torch.float64,
    torch.int8,
    torch.int64,
    torch.bool,
]
TYPES += [torch.complex64, torch.float8_e4m3fn]
SEEN = np.zeros((3, 28), np.float32)


@st.composite
def changed_weights(draw):
    """Weights with other numbers, types, strides, shapes, names, or more layers."""
    weights = draw(st.sampled_from([actor_weights, value_weights]))()
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(weights)))
        change = draw(
            st.sampled_from(
                ["number", "type", "strides", "layers", "lstm", "remove", "sparse", "name"]
            )
        )
        shape = weights[name].shape
        small = shape.numel() < 10**6
        if change == "number" and small:
            weights[name] = torch.full(shape, draw(NUMBERS))
        elif change == "type" and small:
            weights[name] = torch.zeros(shape).to(draw(st.sampled_from(TYPES)))
        elif change == "strides":
            weights[name] = torch.zeros(1).expand(
                draw(SIZES),
                min(draw(SIZES), 10**6),
            )
        elif change == "layers":
            net = draw(
                st.sampled_from(
                    ["mlp_extractor.policy_net", "mlp_extractor.value_net", "q_net.q_net"]
                )
            )
            units = draw(st.integers(0, 2000))
            weights |= {
                f"{net}.{2 * k}.bias": torch.zeros(units) for k in range(draw(st.integers(1, 150)))
            }
        elif change == "lstm":
            wide = 4 * draw(st.integers(0, 2000)), 28
            weights |= {
                f"lstm_actor.weight_ih_l{k}": torch.zeros(wide)
                for k in range(draw(st.integers(1, 3)))
            }
        elif change == "remove" and len(weights) > 1:
            del weights[name]
        elif change == "sparse" and small:
            weights[name] = torch.zeros(shape).to_sparse()
        elif change == "name":
            weights[draw(st.text(max_size=200))] = weights[name]
    return stored(weights)


OPERATORS = [
    "Identity",
    "Relu",
    "Tanh",
    "Exp",
    "Log",
    "Softmax",
    "Transpose",
    "Shape",
    "Size",
    "Loop",
    "If",
    "Scan",
]
OPERATORS += [
    "NonZero",
    "Flatten",
    "Neg",
    "SequenceConstruct",
    "Dropout",
    "ConstantOfShape",
]


@st.composite
def networks(draw):
    """Content of an ONNX file with operators and constants of any kind."""
    names = ["x", "w", "z"]
    nodes = [node("MatMul", "x w", "z")]
    for k in range(draw(st.integers(0, 8))):
        given = draw(st.sampled_from(names))
        kind = draw(st.sampled_from([*OPERATORS, "Concat", "Add", "MatMul", "Expand"]))
        other = (
            f" {draw(st.sampled_from(names))}"
            if kind in ("Concat", "Add", "MatMul", "Expand")
            else ""
        )
        nodes.append(
            node(kind, given + other, f"n{k}", **({"axis": 0} if kind == "Concat" else {}))
        )
        names.append(f"n{k}")
    nodes.append(node("Identity", names[-1], "y"))
    weights = {"w": network(draw(NUMBERS))["w"]}
    shape = draw(
        st.sampled_from([None, ("N", ACTIONS), (1, ACTIONS), (7, ACTIONS), ("N",), (1, ACTIONS, 2)])
    )
    return {
        "nodes": nodes,
        "weights": weights,
        "shape": shape,
    }


def decide(path):
    """Let the policy of a file decide, or check its refusal."""
    decider = accepted(lambda: find_decider(str(path), OPTIONS))
    if decider is not None:
        actions, _ = decider.predict(SEEN)
        assert np.shape(actions) == (len(SEEN),)


def use_zip(content):
    with tempfile.TemporaryDirectory() as folder:
        decide(write_zip(Path(folder) / "model.zip", content))


def use_bytes(content, ending):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"policy{ending}"
        path.write_bytes(content)
        decide(path)


def use_onnx(keywords):
    with tempfile.TemporaryDirectory() as folder:
        decide(write_onnx(Path(folder) / "policy.onnx", **keywords))


def use_yaml(text):
    def parse():
        try:
            return parse_yaml(text)
        except ValueError as error:
            raise ArgumentError(str(reject("yaml", "", str(error).split("\n")[0][:200]))) from None

    accepted(parse)


PARTS = st.sampled_from(
    [":", "59", "1", ".5", "-", "_", "\\", '"', "U", "x", "FFFF", "d800", "!!float ", "!!int "]
)
SPECIAL = st.lists(PARTS, max_size=400).map("".join)
ESCAPES = st.text("0123456789abcdefABCDEF", max_size=8).flatmap(
    lambda digits: st.sampled_from("xuUNq").map(lambda letter: f'a: "\\{letter}{digits}"')
)
TIMES = st.lists(
    st.integers(0, 99),
    min_size=1,
    max_size=400,
).map(lambda parts: "a: " + ":".join(map(str, parts)))


def any_onnx():
    """Content of a sound ONNX file."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_onnx(
            Path(folder) / "policy.onnx",
            [node("MatMul", "x w", "y")],
            {"w": network()["w"]},
        )
        return path.read_bytes()


def any_zip():
    """Content of a sound zip file."""
    with tempfile.TemporaryDirectory() as folder:
        return write_zip(Path(folder) / "model.zip", actor_weights()).read_bytes()


KINDS = {
    "weights": (use_zip, changed_weights),
    "damaged weights": (use_zip, lambda: damaged(stored(actor_weights()))),
    "damaged zip": (
        lambda content: use_bytes(content, ".zip"),
        lambda: damaged(any_zip()),
    ),
    "operators": (use_onnx, networks),
    "damaged onnx": (
        lambda content: use_bytes(content, ".onnx"),
        lambda: damaged(any_onnx()),
    ),
    "yaml": (use_yaml, lambda: SPECIAL | ESCAPES | TIMES | TIMES.map(lambda text: text + ".5")),
}
NEEDS_ONNX = ("operators", "damaged onnx")


@pytest.mark.parametrize("examples", counts(40, 20_000))
@pytest.mark.parametrize("kind", KINDS)
def test_a_random_policy_is_refused_in_one_line_or_decides(kind, examples, tmp_path):
    if kind in NEEDS_ONNX:
        pytest.importorskip("onnxruntime")
        pytest.importorskip("onnx")
    use, values = KINDS[kind]
    write_zip(tmp_path / "model.zip", actor_weights())
    find_decider(str(tmp_path / "model.zip"), OPTIONS)
    attack(examples, values(), use)
