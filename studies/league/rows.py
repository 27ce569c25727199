"""Inputs of the network of rewards, of the rows of an environment with announced switches.

The network sees a row once for each turn hypothesis, from the side of this turn.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import turn_views
from hybrid_env import Layout

Rows = NDArray[np.float32]
# Inputs of a row, for each turn hypothesis.
INPUTS = 33


def row_inputs(rows: Rows) -> tuple[Rows, Rows]:
    """Return the inputs of each turn hypothesis (N, M - 1, 33), and the logarithm of the bank's
    posterior (N, M). Other modes take the places of straight motion, the first one, and of turns,
    which are not mirrored. The rows are (N, width).
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name).astype(np.float32) for name in layout.slices}
    ratio = read["log_ratio"]
    ticks = read["ticks"]
    posterior = np.exp(ratio)
    posterior /= posterior.sum(-1, keepdims=True)
    logs = np.log(np.maximum(posterior, np.exp(np.float32(-30.0))))
    of_hypotheses: list[Any] = [
        2.0 * posterior - 1.0,
        np.maximum(logs, -15.0) / 5.0,
        np.maximum(ratio, -6.0) / 2.0,
        0.5 * read["innovation_along"].clip(-6.0, 6.0),
        0.5 * read["innovation_across"].clip(-6.0, 6.0),
        read["log_variance"],
        read["previous"],
        10.0 * read["turn_angle"],
    ]
    across = 0.1 * read["displacement_across"]
    of_track = [
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        3.0 * np.tanh(across / 3.0),
        0.05 * read["displacement_along"],
        np.clip(across / (ticks / 5.0 + 0.1), -3.0, 3.0),
        0.5 * _log(read["anchor_xx"]),
        0.5 * _log(read["anchor_vv"]) + 2.0,
        read["anchor_xv"],
        0.5 * _log(read["speed"]),
    ]
    # A mirrored trajectory changes the sign of these columns: the lateral innovation and the
    # turn, and of the track the two of the lateral displacement.
    side = np.where(read["turn_angle"][:, 1:] < 0.0, np.float32(-1.0), np.float32(1.0))
    out = turn_views(np.stack(of_hypotheses, -1), logs, side, (4, 7), len(of_track))
    out[..., -len(of_track) :] = np.stack(of_track, -1)[:, None]
    for column in (2, 4):
        out[..., column - len(of_track)] *= side
    return np.clip(out, -5.0, 5.0), logs


def _log(values: Rows) -> Rows:
    return np.log(np.maximum(values, np.float32(1e-30)))
