"""Files of policies of other libraries, sound ones and hostile ones of many kinds; all are for
three hypotheses.
"""

import io
import itertools
import zipfile

import numpy as np
import torch

from hybrid_env import HybridTrackVectorEnv, WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
OPTIONS = WorldOptions(scheme="random 2x20-25")
WIDTH, ACTIONS, HIDDEN = 29, 4, 8


def rows(steps=12):
    """(steps, N, width) rows while nothing is declared."""
    env = HybridTrackVectorEnv(5, **vars(OPTIONS))
    seen = [env.reset(seed=3)[0]]
    seen += [env.step(np.zeros(5, int))[0] for _ in range(steps - 1)]
    return np.array(seen)


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


def value_weights():
    """Weights of a network of action values."""
    return {
        "q_net.q_net.0.weight": torch.zeros(HIDDEN, WIDTH),
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


class Calls:
    """Pickled as a call of a function."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


HOSTILE_ZIPS = {
    "nan": lambda: (
        actor_weights() | {"action_net.weight": torch.full((ACTIONS, HIDDEN), np.nan)},
        "{}",
    ),
    "strides of the right width": lambda: (
        value_weights()
        | {
            f"q_net.q_net.{2 * k}.weight": torch.zeros(1).expand(30_000, 30_000)
            for k in range(2, 9)
        },
        "{}",
    ),
    "a call": lambda: (actor_weights() | {"x": Calls(bytearray, 10**10)}, "{}"),
    "nested data": lambda: (actor_weights(), "[" * 100_000),
    "lists in data": lambda: (actor_weights(), '{"a": [' + "[]," * 4_000_000 + "[]]}"),
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
        inner, "body", given, [info("again", TensorProto.BOOL, []), info("same", 1, None)]
    )
    return [
        node("MatMul", "x w", "logits"),
        helper.make_node("Loop", ["", "true", "logits"], ["y"], body=body),
    ]


def doubled(times):
    """Rows that are joined to themselves many times."""
    names = ["x", *(f"x{k}" for k in range(times))]
    joined = [
        node("Concat", f"{name} {name}", after, axis=0) for name, after in itertools.pairwise(names)
    ]
    return [*joined, node("MatMul", f"{names[-1]} w", "all"), node("Slice", "all zero count", "y")]


def expanded(name, sizes, **attributes):
    """An operator on zeros of large sizes, whose largest number is added to the logits."""
    inner = node(name, "i i" if name in ("Conv", "MatMul") else "i", "p", **attributes)
    return {
        "nodes": [
            node("Expand", "number sizes", "e"),
            # Numbers for which no fast product exists.
            node("Cast", "e", "i", to=7 if name == "MatMul" else 1),
            inner,
            node("Cast", "p", "f", to=1),
            node("ReduceMax", "f", "m", keepdims=0),
            node("MatMul", "x w", "z"),
            node("Add", "z m", "y"),
        ],
        "weights": network() | {"number": np.float32(0.0), "sizes": np.array(sizes)},
    }


def network(number=0.0):
    weights = np.random.default_rng(0).normal(size=(WIDTH, ACTIONS)).astype(np.float32)
    weights[1, 2] += np.float32(number)
    return {"w": weights, "true": np.array(True), "zero": np.array([0]), "count": np.array([2])}


LARGE = np.array([1 << 17, 1 << 16])
HOSTILE_ONNX = {
    "loop": lambda: {"nodes": loop(), "weights": network()},
    "nan": lambda: {"nodes": [node("MatMul", "x w", "y")], "weights": network(np.nan)},
    "nan in the output": lambda: {
        "nodes": [node("MatMul", "x w", "z"), node("Log", "z", "l"), node("Sub", "l l", "y")],
        "weights": network(),
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
    "pool": lambda: expanded("AveragePool", [1, 1, 10**7], kernel_shape=[5 * 10**6]),
    "largest pool": lambda: expanded("MaxPool", [1, 1, 10**7], kernel_shape=[5 * 10**6]),
    "convolution": lambda: expanded("Conv", [1, 1, 10**6]),
    "product": lambda: expanded("MatMul", [3000, 3000]),
    "nodes": lambda: {
        "nodes": [node("Identity", "x", f"x{k}") for k in range(10_000)]
        + [node("MatMul", "x w", "y")],
        "weights": network(),
    },
}
