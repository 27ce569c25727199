"""What the kernel asks of a bank, whichever it is: one name for each operation, chosen by the bank's type.

numba looks at the type of the argument when it compiles, so a kernel holds the one bank that it runs.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.anchor_aware_bank import (
    AWARE,
    AwareBank,
    Ten,
    anchor_aware,
    anchor_covariance,
    step_aware,
    step_hypothesis,
)
from hybrid_env.core.compilation import internal, internal_overload
from hybrid_env.core.in_place import array_at, in_place
from hybrid_env.core.published_bank import (
    COVARIANCE,
    GAIN,
    HYPOTHESIS,
    INNOVATION,
    Bank,
    Quadruple,
    anchor_bank,
    covariance_of,
    step_alone,
    step_bank,
)

IDENTITY: Ten = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
"""P := I of the published algorithms, as an upper triangle."""


@internal
def published(setting: Any, blocks: int) -> Bank:
    """The published banks of all blocks, where `track.PARAMETERS` says."""
    n, axes = setting.radii_count, setting.axes
    return Bank(
        array_at(setting.hypotheses, (blocks, 2 * n + 1), HYPOTHESIS),
        array_at(setting.covariances, (blocks, axes, n + 1), COVARIANCE),
        array_at(setting.innovations, (2 * n + 1,), INNOVATION),
        array_at(setting.gains, (axes, n + 1), GAIN),
    )


@internal
def aware(setting: Any, blocks: int) -> AwareBank:
    """The anchor-aware banks of all blocks."""
    hypotheses = 2 * setting.radii_count + 1
    return AwareBank(
        array_at(setting.hypotheses, (blocks, hypotheses), AWARE),
        array_at(setting.innovations, (hypotheses,), INNOVATION),
    )


def bank_of_block(banks: Any, block: int) -> Any:
    """The bank of one block, out of those of all."""
    raise NotImplementedError("compiled code only")


def begin(
    bank: Any, lane: int, anchor: Quadruple, covariance: Ten, radii: NDArray[np.float64], setting: Any
) -> None:
    """Start every hypothesis of a lane at one estimate; covariance: upper triangle, row by row."""
    raise NotImplementedError("compiled code only")


def step(bank: Any, first: int, last: int, measurement: NDArray[np.float64], setting: Any) -> None:
    """One tick of every hypothesis, for lanes first .. last - 1. measurement: (2, LANES) [m]."""
    raise NotImplementedError("compiled code only")


def follow(bank: Any, lane: int, hypothesis: int, measurement: NDArray[np.float64], setting: Any) -> None:
    """One tick of the decided hypothesis of a lane; its log-likelihood stays."""
    raise NotImplementedError("compiled code only")


def covariance(bank: Any, hypothesis: int, lane: int) -> Any:
    """Covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    raise NotImplementedError("compiled code only")


def _begin_published(bank, lane, anchor, covariance, radii, setting):  # type: ignore[no-untyped-def]
    covariance_x = (covariance[0], covariance[1], covariance[4])
    covariance_y = (covariance[7], covariance[8], covariance[9])
    anchor_bank(bank, lane, anchor, radii, setting.tau, covariance_x, covariance_y)


def _step_published(bank, first, last, measurement, setting):  # type: ignore[no-untyped-def]
    step_bank(
        bank, first, last, measurement, setting.process_variance, setting.variance_x, setting.variance_y
    )


def _follow_published(bank, lane, hypothesis, measurement, setting):  # type: ignore[no-untyped-def]
    step_alone(
        bank, lane, hypothesis, measurement[0, lane], measurement[1, lane],
        setting.process_variance, setting.variance_x, setting.variance_y,
    )  # fmt: skip


def _covariance_published(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    x, y = covariance_of(bank.covariances, hypothesis, lane)
    return x[0], x[1], 0.0, 0.0, x[2], 0.0, 0.0, y[0], y[1], y[2]


def _begin_aware(bank, lane, anchor, covariance, radii, setting):  # type: ignore[no-untyped-def]
    anchor_aware(bank, lane, anchor, radii, covariance)


def _step_aware(bank, first, last, measurement, setting):  # type: ignore[no-untyped-def]
    step_aware(
        bank, first, last, measurement,
        setting.tau, setting.process_variance, setting.variance_x, setting.variance_y,
    )  # fmt: skip


def _follow_aware(bank, lane, hypothesis, measurement, setting):  # type: ignore[no-untyped-def]
    kalman = in_place(bank.hypotheses[hypothesis])
    log_likelihood = kalman.log_likelihood[lane]
    step_hypothesis(
        kalman, in_place(bank.innovations[hypothesis]), lane, lane + 1, measurement,
        setting.tau, setting.process_variance, setting.variance_x, setting.variance_y,
    )  # fmt: skip
    kalman.log_likelihood[lane] = log_likelihood


def _covariance_aware(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    return anchor_covariance(bank.hypotheses, hypothesis, lane)


@internal_overload(bank_of_block)
def _bank_of_block(banks, block):  # type: ignore[no-untyped-def]
    if banks.instance_class is Bank:
        return lambda banks, block: Bank(
            banks.hypotheses[block], banks.covariances[block], banks.innovations, banks.gains
        )
    return lambda banks, block: AwareBank(banks.hypotheses[block], banks.innovations)


@internal_overload(begin)
def _begin(bank, lane, anchor, covariance, radii, setting):  # type: ignore[no-untyped-def]
    return _begin_published if bank.instance_class is Bank else _begin_aware


@internal_overload(step)
def _step(bank, first, last, measurement, setting):  # type: ignore[no-untyped-def]
    return _step_published if bank.instance_class is Bank else _step_aware


@internal_overload(follow)
def _follow(bank, lane, hypothesis, measurement, setting):  # type: ignore[no-untyped-def]
    return _follow_published if bank.instance_class is Bank else _follow_aware


@internal_overload(covariance)
def _covariance(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    return _covariance_published if bank.instance_class is Bank else _covariance_aware
