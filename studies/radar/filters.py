"""The compared filters: those of the thesis, sound settings of the same filters, and robust ones.
Novospaskyi 2025, section 2.2. Each has a function of its parameters and the space in which these
are tuned.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution

from studies.arrays import FloatArray
from studies.filters.correction import StudentT
from studies.filters.gains import AdaptiveFilter, GHFilter
from studies.filters.imm import IMMFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import Estimates, run_filter
from studies.filters.track_filter import TrackFilter
from studies.radar.flights import SPEED
from studies.radar.radars import SIGMA, Tracks

Parameters = Mapping[str, Any]
# Standard deviations of velocity [m/s] and acceleration [m/s^2] at the start.
START_DEVIATIONS = (SPEED / math.sqrt(3.0), 5.0)


def moving_average(values: FloatArray, window: int, ratio: float = 1.0) -> FloatArray:
    """Average each measurement with those of the ticks before it. Novospaskyi 2025, section 2.3.4.

    Of measurements (T, ...) [m], NaN where there is none, one that is i ticks old has the weight
    ratio^i, 0 < ratio <= 1, for i = 0 .. window - 1; missing ones have none, and remain missing.
    With ratio 1 the average is (window - 1) / 2 ticks late. Its errors are correlated in time,
    which no filter here assumes.
    """
    present = ~np.isnan(values)
    sums = np.zeros_like(values)
    weights = np.zeros_like(values)
    known = np.where(present, values, 0.0)
    for age in range(min(window, len(values))):
        weight = ratio**age
        sums[age:] += weight * known[: len(values) - age]
        weights[age:] += weight * present[: len(values) - age]
    return np.where(present, sums / np.where(present, weights, 1.0), np.nan)


@dataclass(frozen=True)
class Contender:
    """A filter with the parameters that are tuned."""

    build: Callable[[Parameters], TrackFilter]
    # Ranges of the parameters, and their values in the first trial.
    space: Mapping[str, tuple[BaseDistribution, float]]


def filter_tracks(contender: Contender, parameters: Parameters, tracks: Tracks) -> Estimates:
    """Estimates after every measurement; the parameters `window` and `ratio` average the
    measurements before the filter.
    """
    measurements = tracks.measurements
    if "window" in parameters:
        measurements = moving_average(measurements, parameters["window"], parameters["ratio"])
    return run_filter(contender.build(parameters), measurements, tracks.times)


class ThesisKalmanFilter(KalmanFilter):
    """A Kalman filter that starts with P0 = 10000 I, the position included."""

    start_variance = 1e4

    def _start(self, chosen: NDArray[np.bool_], measurement: FloatArray, noise: FloatArray) -> None:
        super()._start(chosen, measurement, noise)
        self.covariance[chosen] = self.start_variance * np.eye(self.model.size)


def _thesis_filter(name: Any, parameters: Parameters) -> TrackFilter:
    """KF CV, CA or CJ of the thesis: discrete white noise, P0 = 10000 I. After the start only Q / R
    matters, so that R is that of the Gaussian noise.
    """
    model = MotionModel(name, axes=3, noise=parameters["q"], discretization="discrete")
    deviations = [math.sqrt(ThesisKalmanFilter.start_variance)] * (model.order - 1)
    return ThesisKalmanFilter(model, SIGMA**2, deviations)


# A track of a filter without covariance starts anew after this time without measurements [s], as
# its velocity is of no use then.
LONGEST_GAP = 4.0


def _gh_filter(parameters: Parameters) -> TrackFilter:
    return GHFilter(axes=3, g=parameters["g"], h=parameters["h"], longest_gap=LONGEST_GAP)


def _adaptive_filter(parameters: Parameters) -> TrackFilter:
    return AdaptiveFilter(axes=3, memory=parameters["memory"], longest_gap=LONGEST_GAP)


def _sound_filter(names: Sequence[Any], parameters: Parameters) -> TrackFilter:
    """Kalman filters of some models, with several of them their IMM: continuous white noise with
    the intensity "q CV" or so on all axes, R known up to the parameter "scale", a prior of the
    start, and a robust update if the parameters have one.
    """
    freedom = parameters.get("degrees of freedom")
    robust = None if freedom is None else StudentT(freedom)
    variance = parameters.get("scale", 1.0) * SIGMA**2
    filters = []
    for name in names:
        model = MotionModel(name, axes=3, noise=(parameters[f"q {name}"],) * 3)
        start = START_DEVIATIONS[: model.order - 1]
        filters.append(KalmanFilter(model, variance, start, robust))
    if len(filters) == 1:
        return filters[0]
    return IMMFilter(filters, [parameters[f"sojourn {name}"] for name in names])


def _log(low: float, high: float) -> FloatDistribution:
    return FloatDistribution(low, high, log=True)


def _sound(names: Sequence[str], **space: tuple[float, float]) -> Contender:
    """A `_sound_filter` with the ranges of its parameters; its tuning starts in the logarithmic
    middle of each.
    """
    return Contender(
        partial(_sound_filter, names),
        {
            key.replace("_", " "): (_log(low, high), math.sqrt(low * high))
            for key, (low, high) in space.items()
        },
    )


_AVERAGE: dict[str, tuple[BaseDistribution, float]] = {
    "window": (IntDistribution(1, 13), 2),
    "ratio": (_log(1e-3, 0.5), 0.05),
}
# One set of parameters for both noises; the process noise is that of the sound CV with Gaussian
# noise.
ROBUST = "CV, Student-t"
# The IMM and the robust update of the Student-t CV, with the parameters that each has alone.
COMBINED = "IMM, Student-t"
CONTENDERS = {
    # As in the thesis, with the moving average.
    "g-h": Contender(
        _gh_filter,
        {"g": (FloatDistribution(0.05, 1.0), 0.6), "h": (FloatDistribution(0.005, 0.6), 0.2)}
        | _AVERAGE,
    ),
    **{
        f"KF {name}": Contender(
            partial(_thesis_filter, name), {"q": (_log(1e-4, 1e4), 1.0)} | _AVERAGE
        )
        for name in ("CV", "CA", "CJ")
    },
    # Finds its gains, and needs no average.
    "adaptive": Contender(_adaptive_filter, {"memory": (_log(5.0, 500.0), 50.0)}),
    # Without averaging; R of the Gaussian noise known, continuous process noise, a prior of the
    # start.
    "CV": _sound(("CV",), q_CV=(0.1, 1e3)),
    "IMM (CV, CA)": _sound(
        ("CV", "CA"),
        q_CV=(0.1, 1e3),
        q_CA=(1e-3, 1e2),
        sojourn_CV=(1.0, 300.0),
        sojourn_CA=(1.0, 300.0),
    ),
    ROBUST: _sound(("CV",), degrees_of_freedom=(2.0, 50.0), scale=(0.2, 1.5)),
    COMBINED: _sound(("CV", "CA")),
}
