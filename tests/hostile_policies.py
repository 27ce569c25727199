"""Files of policies of other libraries, sound ones and hostile ones of many kinds; all are for
three hypotheses.
"""

import io
import itertools
import json
import zipfile

import numpy as np
import torch

from hybrid_env import HybridTrackVectorEnv, WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
OPTIONS = WorldOptions(scheme="random 2x20-25")
WIDTH, ACTIONS, HIDDEN = 28, 4, 8


def rows(steps=12):
    """(steps, N, width) rows while nothing is declared."""
    env = HybridTrackVectorEnv(5, **vars(OPTIONS))
    found = [env.reset(seed=3)[0]]
    found += [env.step(np.zeros(5, int))[0] for _ in range(steps - 1)]
    return np.array(found)


def actor_weights():
    """Weights of a small actor and critic of Stable-Baselines3."""
    generator = torch.Generator().manual_seed(0)
    shapes = {
        "mlp_extractor.policy_net.0": (HIDDEN, WIDTH),
        "mlp_extractor.value_net.0": (HIDDEN, WIDTH),
        "action_net": (ACTIONS, HIDDEN),
        "value_net": (1, HIDDEN),
    }
    weights = {}
    for name, shape in shapes.items():
        weights[f"{name}.weight"] = torch.randn(shape, generator=generator)
        weights[f"{name}.bias"] = torch.zeros(shape[0])
    return weights


def value_weights(width=WIDTH):
    """Weights of a network of action values."""
    return {
        "q_net.q_net.0.weight": torch.zeros(HIDDEN, width),
        "q_net.q_net.0.bias": torch.zeros(HIDDEN),
        "q_net.q_net.2.weight": torch.zeros(ACTIONS, HIDDEN),
        "q_net.q_net.2.bias": torch.zeros(ACTIONS),
    }


def stored(weights, compression=zipfile.ZIP_STORED, more=()):
    """Content of "policy.pth", with further records."""
    plain = io.BytesIO()
    torch.save(weights, plain)
    packed = io.BytesIO()
    with zipfile.ZipFile(plain) as given, zipfile.ZipFile(packed, "w", compression) as file:
        for name in given.namelist():
            file.writestr(name, given.read(name))
        for name, content in more:
            file.writestr(name, content)
    return packed.getvalue()


def write_zip(path, weights, data="{}", compression=zipfile.ZIP_STORED):
    """Write a model of Stable-Baselines3: its weights, or the content of "policy.pth"."""
    content = weights if isinstance(weights, bytes) else stored(weights)
    with zipfile.ZipFile(path, "w", compression) as file:
        file.writestr("data", data)
        file.writestr("policy.pth", content)
    return path


def with_value(number, name="action_net.weight"):
    """Weights of which one is a number."""
    weights = actor_weights()
    weights[name].view(-1)[3] = number
    return weights


def of_type(dtype):
    return {name: tensor.to(dtype) for name, tensor in actor_weights().items()}


def layers(count, name="mlp_extractor.policy_net.{}.bias", units=2000):
    """Weights with many layers, of which the file stores little."""
    return actor_weights() | {name.format(2 * k): torch.zeros(units) for k in range(1, count)}


def recurrent(count, hidden):
    """Weights with layers of an LSTM, of which the file stores little."""
    wide = {
        f"lstm_actor.weight_ih_l{k}": torch.zeros(1).expand(4 * hidden, WIDTH) for k in range(count)
    }
    return actor_weights() | wide


def shared(count):
    """Weights that all share the numbers of one."""
    one = torch.zeros(2000, 2000)
    return actor_weights() | {
        f"mlp_extractor.policy_net.{2 * k}.weight": one for k in range(1, count)
    }


class Calls:
    """Pickled as a call of a function."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


def strided(count, name="q_net.q_net.0.weight"):
    """Weights of which one repeats a single number."""
    return value_weights() | {name: torch.zeros(1).expand(HIDDEN, count)}


def nested_data():
    return "[" * 100_000


TYPES = torch.float16, torch.bfloat16, torch.float64
SOUND_ZIPS = {str(dtype): lambda dtype=dtype: (of_type(dtype), "{}") for dtype in TYPES}
HOSTILE_ZIPS = {
    "nan": lambda: (with_value(np.nan), "{}"),
    "infinite": lambda: (with_value(-np.inf, "value_net.weight"), "{}"),
    "infinite as float32": lambda: (
        of_type(torch.float64) | {"value_net.bias": torch.full((1,), 1e300, dtype=torch.float64)},
        "{}",
    ),
    "complex": lambda: (of_type(torch.complex64), "{}"),
    "sparse": lambda: (
        {name: tensor.to_sparse() for name, tensor in actor_weights().items()},
        "{}",
    ),
    "meta": lambda: ({name: tensor.to("meta") for name, tensor in actor_weights().items()}, "{}"),
    "a list": lambda: (list(actor_weights().values()), "{}"),
    "no tensors": lambda: (dict.fromkeys(actor_weights(), 1.0), "{}"),
    "strides": lambda: (strided(10**8), "{}"),
    "strides of the right width": lambda: (
        value_weights()
        | {
            f"q_net.q_net.{2 * k}.weight": torch.zeros(1).expand(30_000, 30_000)
            for k in range(2, 9)
        },
        "{}",
    ),
    "shared numbers": lambda: (shared(100), "{}"),
    "layers": lambda: (layers(400), "{}"),
    "fewer layers": lambda: (layers(100), "{}"),
    "wide layers": lambda: (layers(3, units=200_000), "{}"),
    "layers of a critic": lambda: (layers(100, "mlp_extractor.value_net.{}.bias"), "{}"),
    "layers of an LSTM": lambda: (recurrent(500, 2000), "{}"),
    "a wide LSTM": lambda: (recurrent(1, 10**6), "{}"),
    "long names": lambda: (actor_weights() | {"x" * 50_000: torch.zeros(1)}, "{}"),
    "names of two lines": lambda: (actor_weights() | {"a\nb": torch.zeros(1)}, "{}"),
    "numbers as names": lambda: (actor_weights() | {3: torch.zeros(1)}, "{}"),
    "a call": lambda: (actor_weights() | {"x": Calls(bytearray, 10**10)}, "{}"),
    "nested data": lambda: (actor_weights(), nested_data()),
    "data of another form": lambda: (actor_weights(), "[1]"),
    "activation": lambda: (
        actor_weights(),
        json.dumps({"policy_kwargs": {"activation_fn": "x" * 10_000}}),
    ),
    "quantiles": lambda: (
        {
            name.replace("q_net.q_net", "quantile_net.quantile_net"): part
            for name, part in value_weights().items()
        },
        json.dumps({"policy_kwargs": {"n_quantiles": 3}}),
    ),
    "zeros": lambda: (
        stored(actor_weights(), zipfile.ZIP_DEFLATED, [("archive/zeros", bytes(2**27))]),
        "{}",
    ),
    "text": lambda: (b"not a zip file", "{}"),
}


def write_onnx(path, nodes, weights=(), shape=("N", ACTIONS), kind=1, **keywords):
    """Write an ONNX file that calculates "y" from "x"; the type of "y" is `kind`, 1 for float32."""
    import onnx

    helper = onnx.helper
    given = helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, ["N", WIDTH])
    out = helper.make_tensor_value_info("y", kind, shape)
    constants = [
        onnx.numpy_helper.from_array(np.asarray(values), name)
        for name, values in dict(weights).items()
    ]
    graph = helper.make_graph(nodes, "policy", [given], [out], constants, **keywords)
    versions = [helper.make_opsetid("", 17), helper.make_opsetid("own", 1)]
    path.write_bytes(
        helper.make_model(graph, opset_imports=versions, ir_version=8).SerializeToString()
    )
    return path


def node(name, given, out, **attributes):
    from onnx import helper

    return helper.make_node(name, given.split(), out.split(), **attributes)


def loop():
    """A loop without an end."""
    from onnx import TensorProto, helper

    info = helper.make_tensor_value_info
    inner = [node("Identity", "go_on", "again"), node("Identity", "rows", "same")]
    given = [
        info("k", TensorProto.INT64, []),
        info("go_on", TensorProto.BOOL, []),
        info("rows", 1, ["N", ACTIONS]),
    ]
    body = helper.make_graph(
        inner,
        "body",
        given,
        [info("again", TensorProto.BOOL, []), info("same", 1, None)],
    )
    return [
        node("MatMul", "x w", "logits"),
        helper.make_node("Loop", ["", "true", "logits"], ["y"], body=body),
    ]


def branch():
    """A branch, both parts of which are a network."""
    from onnx import helper

    parts = [
        helper.make_graph(
            [node("MatMul", "x w", name)],
            name,
            [],
            [helper.make_tensor_value_info(name, 1, None)],
        )
        for name in ("yes", "no")
    ]
    return [
        node(
            "If",
            "true",
            "y",
            then_branch=parts[0],
            else_branch=parts[1],
        )
    ]


def doubled(times):
    """Rows that are joined to themselves many times."""
    names = ["x", *(f"x{k}" for k in range(times))]
    joined = [
        node("Concat", f"{name} {name}", after, axis=0) for name, after in itertools.pairwise(names)
    ]
    return [*joined, node("MatMul", f"{names[-1]} w", "all"), node("Slice", "all zero count", "y")]


def network(number=0.0):
    weights = np.random.default_rng(0).normal(size=(WIDTH, ACTIONS)).astype(np.float32)
    weights[1, 2] += np.float32(number)
    return {
        "w": weights,
        "true": np.array(True),
        "zero": np.array([0]),
        "count": np.array([2]),
    }


def constant(shape):
    """Weights and a node that returns them, whatever the rows are."""
    return {
        "nodes": [node("Identity", "w", "y")],
        "weights": {"w": np.ones(shape, np.float32)},
        "shape": None,
    }


LARGE = np.array([1 << 17, 1 << 16])
HOSTILE_ONNX = {
    "loop": lambda: {"nodes": loop(), "weights": network()},
    "branch": lambda: {
        "nodes": branch(),
        "weights": network(),
        "shape": None,
    },
    "nan": lambda: {"nodes": [node("MatMul", "x w", "y")], "weights": network(np.nan)},
    "infinite": lambda: {"nodes": [node("MatMul", "x w", "y")], "weights": network(np.inf)},
    "nan that is not used": lambda: {
        "nodes": [node("MatMul", "x w", "y")],
        "weights": network() | {"more": np.array([np.nan], np.float32)},
    },
    "nan in a node": lambda: {
        "nodes": [
            node("Constant", "", "c", value_floats=[float("nan")] * 4),
            node("MatMul", "x w", "z"),
            node("Add", "z c", "y"),
        ],
        "weights": network(),
    },
    "nan in the output": lambda: {
        "nodes": [node("MatMul", "x w", "z"), node("Log", "z", "l"), node("Sub", "l l", "y")],
        "weights": network(),
    },
    "one row": lambda: constant((1, ACTIONS)),
    "two rows": lambda: constant((2, ACTIONS)),
    "seven rows": lambda: constant((7, ACTIONS)),
    "a number for each action": lambda: constant(ACTIONS),
    "two numbers": lambda: constant(2),
    "one number": lambda: constant(()),
    "rank 3": lambda: constant((1, ACTIONS, 2)),
    "rank 3 of rows": lambda: {
        "nodes": [
            node("MatMul", "x w", "z"),
            node("Unsqueeze", "z zero", "u"),
            node("Transpose", "u", "y", perm=[1, 0, 2]),
        ],
        "weights": network(),
        "shape": None,
    },
    "columns": lambda: {
        "nodes": [node("MatMul", "x w", "z"), node("Transpose", "z", "y")],
        "weights": network(),
        "shape": None,
    },
    "too many actions": lambda: {"nodes": [node("Identity", "x", "y")], "shape": None},
    "actions as fractions": lambda: {
        "nodes": [node("ReduceMean", "x", "y", axes=[1], keepdims=0)],
        "shape": ["N"],
    },
    "operator of its own": lambda: {"nodes": [node("Net", "x", "y", domain="own")]},
    "random numbers": lambda: {"nodes": [node("RandomNormalLike", "x", "y")], "shape": None},
    "doubled rows": lambda: {"nodes": doubled(26), "weights": network()},
    "large constant": lambda: {
        "nodes": [
            node("ConstantOfShape", "size", "c"),
            node("ReduceMean", "c", "m", keepdims=0),
            node("MatMul", "x w", "z"),
            node("Add", "z m", "y"),
        ],
        "weights": network() | {"size": LARGE},
    },
    "expanded": lambda: {
        "nodes": [
            node("Expand", "first size", "c"),
            node("ReduceMean", "c", "m", keepdims=0),
            node("MatMul", "x w", "z"),
            node("Add", "z m", "y"),
        ],
        "weights": network() | {"size": LARGE, "first": np.ones((1, 1), np.float32)},
    },
    "nodes": lambda: {
        "nodes": [node("Identity", "x", f"x{k}") for k in range(10_000)]
        + [node("MatMul", "x w", "y")],
        "weights": network(),
    },
}
