"""ONNX files of policies: only operators that end, and a first call that is bounded, are
accepted.
"""

import functools
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.learned.policy_file import LARGEST_FILE, LARGEST_WEIGHT, LARGEST_WIDTH

OPERATORS = (
    # Arithmetic.
    "Abs Add Ceil Clip Div Erf Exp Floor Log Max Mean Min Mod Mul Neg Pow Reciprocal Round Sign"
    " Sqrt Sub Sum Sin Cos "
    # Comparisons.
    "And Equal Greater GreaterOrEqual IsInf IsNaN Less LessOrEqual Not Or Where Xor "
    # Shapes and indices.
    "Cast CastLike Concat Constant ConstantOfShape Expand Flatten Gather GatherElements GatherND"
    " Identity Pad Range Reshape ScatterElements ScatterND Shape Size Slice Split Squeeze Tile"
    " Transpose Trilu Unsqueeze "
    # Sums and choices along an axis.
    "ArgMax ArgMin CumSum OneHot ReduceL1 ReduceL2 ReduceLogSum ReduceLogSumExp ReduceMax"
    " ReduceMean ReduceMin ReduceProd ReduceSum ReduceSumSquare TopK "
    # Layers.
    "BatchNormalization Dropout Einsum GRU Gemm GlobalAveragePool GlobalMaxPool GroupNormalization"
    " InstanceNormalization LSTM LayerNormalization LpNormalization MatMul RMSNormalization RNN "
    # Activation functions.
    "Celu Elu Gelu HardSigmoid HardSwish Hardmax LeakyRelu LogSoftmax Mish PRelu Relu Selu Sigmoid"
    " Softmax Softplus Softsign Swish Tanh ThresholdedRelu"
)
"""What exports of feed-forward and recurrent networks need, without loops, branches, random numbers
and windows: the time of a convolution or a pool grows with the product of two sizes of a file.
"""

# Bytes of what one of the first calls computes between its input and its output, which bounds the
# time of each operator.
LARGEST_INNER = 2**24


def read_network(path: Path) -> tuple[Callable[[Any], NDArray[Any]], tuple[int, ...]]:
    """Return the function of an ONNX file, from rows (N, width) to its first output, and what
    the function needs.

    The first output are logits (N, A), then the second value is (width, A), or actions (N,), then
    it is (width,).

    Raises:
        Exception: of any kind with one line, if the file is damaged or not allowed.
        ImportError: the package onnx or onnxruntime is not installed.
    """
    content = _checked_model(path)
    import onnxruntime

    limited, free = onnxruntime.SessionOptions(), onnxruntime.SessionOptions()
    for settings in (limited, free):
        settings.intra_op_num_threads = settings.inter_op_num_threads = 1
        # Fatal errors only.
        settings.log_severity_level = 4
    # What is computed ahead of a call when a graph is optimised has no bounds.
    limited.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    limited.add_session_config_entry("session.use_env_allocators", "1")
    # Weights are not counted, which may be many more.
    limited.add_session_config_entry("session.use_device_allocator_for_initializers", "1")
    limited.add_session_config_entry("session.disable_prepacking", "1")
    _limit_memory()
    providers = ["CPUExecutionProvider"]
    widths = _check_calls(onnxruntime.InferenceSession(content, limited, providers=providers))
    # It is now known to be small; calls with the rows of many tracks need more memory.
    session = onnxruntime.InferenceSession(content, free, providers=providers)
    given = session.get_inputs()[0].name
    out = session.get_outputs()[0].name
    return lambda rows: session.run([out], {given: np.asarray(rows, np.float32)})[0], widths


@functools.cache
def _limit_memory() -> None:
    """Bound the memory of all sessions with the setting "session.use_env_allocators"."""
    import onnxruntime

    kinds = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, onnxruntime.OrtMemType.DEFAULT
    limits = onnxruntime.OrtArenaCfg({"max_mem": LARGEST_INNER, "arena_extend_strategy": 1})
    onnxruntime.create_and_register_allocator(
        onnxruntime.OrtMemoryInfo("Cpu", kinds[0], 0, kinds[1]), limits
    )


def _checked_model(path: Path) -> bytes:
    """Return the content of an ONNX file whose operators are known and whose weights are finite."""
    import onnx

    # A parser needs a hundred times as many bytes.
    if path.stat().st_size > 2**23:
        raise ValueError(f"it is larger than {2**23:,} bytes: export it with external data")
    model = onnx.load(path, load_external_data=False)
    nodes = model.graph.node
    if len(nodes) > 2000 or model.functions or model.graph.sparse_initializer:
        raise ValueError("it has more than 2000 nodes, functions of its own or sparse weights")
    for node in nodes:
        if node.domain not in ("", "ai.onnx") or node.op_type not in OPERATORS.split():
            raise ValueError(
                f"its operator {node.op_type[:40]!r} is not one of a feed-forward or recurrent"
                " network"
            )
        if any(
            part.HasField("g") or part.graphs or part.HasField("sparse_tensor")
            for part in node.attribute
        ):
            raise ValueError(
                f"its operator {node.op_type!r} has a graph or sparse numbers of its own"
            )
    parts = [part for node in nodes for part in node.attribute]
    tensors = [*model.graph.initializer, *(part.t for part in parts if part.HasField("t"))]
    _load_external(model, tensors, path.parent)
    weights = [(tensor.name, onnx.numpy_helper.to_array(tensor)) for tensor in tensors]
    for name, values in weights + [(part.name, np.array([*part.floats, part.f])) for part in parts]:
        # A number without dimensions may stand for "never", as infinite ones do in masks.
        limit = LARGEST_WEIGHT if values.ndim else np.inf
        if np.issubdtype(values.dtype, np.floating) and not (np.abs(values) <= limit).all():
            raise ValueError(
                f"{name[:40]!r} is not of finite numbers of magnitude at most {LARGEST_WEIGHT:g}"
            )
    content: bytes = model.SerializeToString()
    return content


def _load_external(model: Any, tensors: list[Any], folder: Path) -> None:
    """Read the weights that lie in files beside a model; `ValueError` if they are too large."""
    from onnx import external_data_helper as external

    given = [
        external.ExternalDataInfo(tensor)
        for tensor in tensors
        if external.uses_external_data(tensor)
    ]
    if sum(info.length or (folder / info.location).stat().st_size for info in given) > LARGEST_FILE:
        raise ValueError(f"its weights are larger than {LARGEST_FILE:,} bytes")
    external.load_external_data_for_model(model, str(folder))


def _check_calls(session: Any) -> tuple[int, ...]:
    """Return the width of the input of a session, and the shape of its output without the first
    dimension.
    """
    import onnxruntime

    given = session.get_inputs()
    out = session.get_outputs()[0]
    if len(given) != 1 or given[0].type != "tensor(float)" or len(given[0].shape) != 2:
        raise ValueError("its input is not float32 rows (N, width)")
    tracks, width = given[0].shape
    if isinstance(tracks, int):
        raise ValueError(f"it is for {tracks} rows: export it with a free first dimension")
    if not isinstance(width, int) or not 0 < width <= LARGEST_WIDTH:
        raise ValueError(f"the width of its rows is not a number up to {LARGEST_WIDTH}")
    # Not two rows alone, for which two numbers would do.
    for count in (2, 3):
        running = onnxruntime.RunOptions()
        stop = threading.Timer(2.0, setattr, (running, "terminate", True))
        stop.start()
        try:
            values = session.run(
                [out.name], {given[0].name: np.zeros((count, width), np.float32)}, running
            )[0]
        finally:
            stop.cancel()
        shape = np.shape(values)
        if len(shape) not in (1, 2) or shape[0] != count:
            raise ValueError(
                f"its output for {count} rows has the shape {shape}, not ({count}, A) or ({count},)"
            )
        if not np.isfinite(values).all():
            raise ValueError("its output is not finite")
        if len(shape) == 1 and values.dtype.kind not in "iu":
            raise ValueError(
                f"its output for {count} rows is of {values.dtype}, not of logits or actions"
            )
    return width, *shape[1:]
