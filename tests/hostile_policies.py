"""Files of policies of other libraries, sound ones and hostile ones of many kinds; all are for
three hypotheses.
"""

import io
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
