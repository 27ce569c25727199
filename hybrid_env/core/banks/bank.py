"""What all banks share: types, the innovations, the model, and the order of the hypotheses: with
turn radii, 0 is straight, 1 .. n are left turns, n + 1 .. 2n are right turns.
"""

import math
from typing import Any, NamedTuple

from hybrid_env.core.arrays import AnyArray, FloatArray, IntArray
from hybrid_env.core.banks.filter import Filter, of_four, of_seven
from hybrid_env.core.compilation import internal, selected
from hybrid_env.core.memory import (
    State,
    Triangle4,
    allocate,
    declared,
    four_of,
    triangle_of,
    write_four,
    write_lane,
)
from hybrid_env.core.vectors import Vector


class FilterModel(NamedTuple):
    """The model assumed by the filters. `memory.PARAMETERS` has the same fields."""

    tau: float
    process_variance: float
    variance_x: float
    variance_y: float
    stay_probability: float = 1.0
    switch_probability: float = 0.0
    freedom: float = 0.0
    exact_anchor: float = 0.0
    drift_variance: float = 0.0
    climb_variance: float = 0.0
    height_variance: float = 1.0


@internal
def filter_model(setting: Any) -> FilterModel:
    """Return the model of the filters from a record `memory.PARAMETERS`."""
    return FilterModel(
        setting.tau,
        setting.process_variance,
        setting.variance_x,
        setting.variance_y,
        setting.stay_probability,
        setting.switch_probability,
        setting.freedom,
        setting.exact_anchor,
        setting.drift_variance,
        setting.climb_variance,
        setting.height_variance,
    )


@internal
def alike(measured: Any, first: int, last: int, sensors: AnyArray, model: FilterModel) -> bool:
    """Return whether all of some lanes have a position of variance R, with normal errors, by which
    `filter.correct` corrects them at once; else `sensing.correct_by_sensors` does one by one.
    """
    missing = 0
    for lane in range(first, last):
        missing += 1 if math.isnan(measured.measurement[0, lane]) else 0
    return sensors.size == 0 and model.freedom == 0.0 and missing == 0


motions_of = selected(
    lambda bank: (lambda bank: bank.motions) if "motions" in bank.fields else (lambda bank: None)
)
"""Return the modes of a bank, records `MOTION`; None where all are straight motion and turns."""


@internal
def motion_at(motions: AnyArray | None, hypothesis: int) -> Any:
    """Return the mode of a hypothesis, from `motions_of`."""
    if motions is None:
        return None
    return motions[hypothesis]


def bank_arrays(bank: Any, radii_count: int, axes: int = 1, modes: int | None = None) -> Any:
    """Return a bank of zeros for n radii and 1 or 2 distinct axes, of one block of tracks. modes:
    M, if it is not 2 n + 1.
    """
    sizes = {
        "modes": 2 * radii_count + 1 if modes is None else modes,
        "columns": radii_count + 1,
        "axes": axes,
        "blocks_count": 1,
        "height_rows": 0,
    }
    arrays = {name: allocate(array, sizes) for name, array in declared(bank).items()}
    return bank(**arrays | {name: arrays[name][0] for name in declared(bank, "block")})


@internal
def signed_radius(hypothesis: int, radii: FloatArray) -> float:
    """Return the radius of a hypothesis [m], positive to the left, negative to the right, 0 if
    straight.
    """
    if hypothesis == 0:
        return 0.0
    return (
        radii[hypothesis - 1] if hypothesis <= radii.size else -radii[hypothesis - radii.size - 1]
    )


@internal
def radius_of(motion: Any, hypothesis: int, radii: FloatArray) -> float:
    """Return the same of a hypothesis whose mode is from `motion_at`; 0 if it is no turn."""
    if motion is None:
        return signed_radius(hypothesis, radii)
    return float(motion.signed_radius)


@internal
def radius_column(hypothesis: int, radii_count: int) -> int:
    """Return the column of `covariances` and `gains` of a hypothesis."""
    return hypothesis - radii_count if hypothesis > radii_count else hypothesis


@internal
def set_estimate(kalman: Any, lane: int, estimate: State) -> None:
    """Set the estimate [x, vx, y, vy] of a filter without its covariance and centre."""
    kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = estimate


@internal
def likeliest(hypotheses: AnyArray, lane: int) -> int:
    """Return the hypothesis with the maximum log-likelihood, the first one if several are equal."""
    best = 0
    for h in range(1, hypotheses.size):
        if hypotheses[h].log_likelihood[lane] > hypotheses[best].log_likelihood[lane]:
            best = h
    return best


@internal
def likeliest_of_type(hypotheses: AnyArray, types: IntArray, lane: int, of_type: int) -> int:
    """Return the most likely hypothesis of a type. types: (M,), the type of every hypothesis."""
    best = -1
    for h in range(hypotheses.size):
        if types[h] == of_type and (
            best < 0 or hypotheses[h].log_likelihood[lane] > hypotheses[best].log_likelihood[lane]
        ):
            best = h
    return best


@internal
def estimate_of(hypotheses: AnyArray, hypothesis: int, lane: int) -> State:
    """Return the estimate [x, vx, y, vy] of one hypothesis [m, m/s]."""
    kalman = hypotheses[hypothesis]
    return kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]


@internal
def state_of(kalman: Any, lane: int) -> Vector:
    """Return the state of a filter of seven states."""
    estimate = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    return (*estimate, kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane])


@internal
def set_state(kalman: Any, lane: int, state: Vector) -> None:
    """Set the state of a filter of seven states."""
    kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = state[:4]
    kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane] = state[4:]


@internal
def covariance7(kalman: Any, lane: int) -> Vector:
    """Return the covariance of the seven states of a filter, upper triangle row by row."""
    P = kalman.covariance
    first = four_of(P, 0, lane) + four_of(P, 4, lane) + four_of(P, 8, lane) + four_of(P, 12, lane)
    return first + four_of(P, 16, lane) + four_of(P, 20, lane) + four_of(P, 24, lane)


@internal
def set_covariance(kalman: Any, lane: int, p: Vector) -> None:
    """Set the covariance of the seven states of a filter."""
    P = kalman.covariance
    # A loop over so many entries would not become SIMD code.
    write_four(P, 0, lane, p[:4])
    write_four(P, 4, lane, p[4:8])
    write_four(P, 8, lane, p[8:12])
    write_four(P, 12, lane, p[12:16])
    write_four(P, 16, lane, p[16:20])
    write_four(P, 20, lane, p[20:24])
    write_four(P, 24, lane, p[24:])


@internal
def _read_seven(kalman: Any, lane: int) -> Filter:
    return state_of(kalman, lane), covariance7(kalman, lane)


@internal
def _read_four(kalman: Any, lane: int) -> Filter:
    estimate = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    return estimate, triangle_of(kalman.covariance, lane)


@internal
def _write_seven(kalman: Any, lane: int, state: Vector, p: Vector) -> None:
    set_state(kalman, lane, state)
    set_covariance(kalman, lane, p)


@internal
def _write_four(kalman: Any, lane: int, state: Vector, p: Vector) -> None:
    set_estimate(kalman, lane, state)
    write_lane(kalman.covariance, lane, p)


@internal
def _estimate_in_seven(kalman: Any, lane: int, estimate: State, p: Triangle4) -> None:
    _write_seven(kalman, lane, (*estimate, 0.0, 0.0, 0.0), of_seven(p))


def _by_states(seven: Any, four: Any) -> Any:
    """Return an operation on a filter of seven or of four states."""
    return selected(lambda kalman: seven if "centre_x" in kalman.fields else four)


read_filter = _by_states(_read_seven, _read_four)
"""Return state and covariance of a filter."""

write_filter = _by_states(_write_seven, _write_four)
"""Set state and covariance of a filter."""

write_estimate = _by_states(_estimate_in_seven, _write_four)
"""Set [x, vx, y, vy] of a filter and their covariance; other states become 0."""


@internal
def covariance_of(kalman: Any, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one filter, upper triangle row by row."""
    return of_four(covariance7(kalman, lane))
