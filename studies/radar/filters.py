"""The compared filters: those of the thesis, sound settings of the same filters, and robust ones.
Novospaskyi 2025, section 2.2. Each has a function of its parameters and the space in which these
are tuned.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution

from baselines import (
    Correntropy,
    GHFilter,
    Huber,
    IMMFilter,
    KalmanFilter,
    MotionModel,
    StudentT,
    TrackFilter,
    run_filter,
)
from studies.radar.flights import SPEED
from studies.radar.particles import ParticleFilter
from studies.radar.radars import SIGMA, Tracks

FloatArray = NDArray[np.float64]
Parameters = Mapping[str, Any]

# Time without measurements after which the g-h filter starts anew [s]; its velocity is of no use
# then.
LONGEST_GAP = 4.0
# Parameter: intensity of the process noise on the vertical axis; without it, that of the others.
VERTICAL = "vertical q"
# P0 = 10000 I of the thesis, for every component of the state.
START_VARIANCE = 1e4
# Of the particle filter.
PARTICLES = 500
# Robust update that a parameter belongs to.
UPDATES: dict[str, Callable[[float], Any]] = {
    "threshold": Huber,
    "degrees of freedom": StudentT,
    "width": Correntropy,
}
# Standard deviations of velocity [m/s], acceleration [m/s^2] and jerk [m/s^3] at the start.
START_DEVIATIONS = (SPEED / math.sqrt(3.0), 5.0, 2.0)


class Estimated(NamedTuple):
    """Estimates of N flights after K measurements."""

    # (K, N, 3) [m]
    positions: FloatArray
    # (K, N, 3) [m/s]
    velocities: FloatArray
    # Forecast positions, (K, N, 3) [m], and their covariances if there are any, (K, N, 3, 3) [m^2].
    forecasts: tuple[tuple[FloatArray, FloatArray | None], ...] = ()


def moving_average(
    values: FloatArray,
    window: int,
    ratio: float = 1.0,
) -> FloatArray:
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
    return np.where(
        present,
        sums / np.where(present, weights, 1.0),
        np.nan,
    )


@dataclass(frozen=True)
class Contender:
    """A filter with the parameters that are tuned."""

    build: Callable[[Parameters], TrackFilter]
    space: Mapping[str, BaseDistribution]
    # Of the first trial.
    start: Parameters
    # Of the measurements before the filter, with the parameters `window` and `ratio`.
    averages: bool = False
    # Most trials of a tuning.
    trials: int | None = None


def filter_tracks(
    contender: Contender,
    parameters: Parameters,
    tracks: Tracks,
    horizons: Sequence[float] = (),
) -> Estimated:
    """Estimates after every measurement, with forecasts at horizons [s]."""
    measurements = np.swapaxes(tracks.measurements, 0, 1)
    if contender.averages:
        measurements = moving_average(measurements, parameters["window"], parameters["ratio"])
    found = run_filter(
        contender.build(parameters),
        measurements,
        tracks.times.T,
        keep_covariances=bool(horizons),
        horizons=horizons,
    )
    forecasts = []
    for ahead in found.forecasts:
        spread = ahead.covariances
        if spread is not None:
            spread = spread[..., :: ahead.order, :: ahead.order]
        forecasts.append((ahead.positions, spread))
    return Estimated(found.positions, found.velocities, tuple(forecasts))


def run_contender(
    contender: Contender,
    parameters: Parameters,
    tracks: Tracks,
) -> tuple[FloatArray, FloatArray]:
    """Estimated positions [m] and velocities [m/s] after every measurement, each (N, K, 3)."""
    found = filter_tracks(contender, parameters, tracks)
    return np.swapaxes(found.positions, 0, 1), np.swapaxes(found.velocities, 0, 1)


class ThesisKalmanFilter(KalmanFilter):
    """A Kalman filter that starts with P0 = 10000 I, the position included."""

    def _start(
        self,
        chosen: NDArray[np.int64],
        measurement: FloatArray,
        noise: FloatArray,
    ) -> None:
        super()._start(chosen, measurement, noise)
        self.covariance[chosen] = START_VARIANCE * np.eye(self.model.size)


def _thesis_filter(name: Any, parameters: Parameters) -> TrackFilter:
    """KF CV, CA or CJ of the thesis: discrete white noise, P0 = 10000 I. After the start only Q / R
    matters, so that R is that of the Gaussian noise, except with the published parameters.
    "sigma_q" is taken for a variance: as such it gives the velocity errors of the published order
    for KF CV.
    """
    model = MotionModel(
        name,
        axes=3,
        noise=parameters["q"],
        discretization="discrete",
    )
    deviations = [math.sqrt(START_VARIANCE)] * (model.order - 1)
    return ThesisKalmanFilter(
        model,
        parameters.get("variances", SIGMA**2),
        deviations,
    )


def _gh_filter(parameters: Parameters) -> TrackFilter:
    return GHFilter(
        axes=3,
        g=parameters["g"],
        h=parameters["h"],
        longest_gap=LONGEST_GAP,
    )


def _sound_filter(names: Sequence[Any], parameters: Parameters) -> TrackFilter:
    """Kalman filters of some models, with several of them their IMM: continuous white noise with
    the intensity "q CV" or so on all axes, R known up to the parameter "scale", a prior of the
    start, and a robust update if the parameters have one.
    """
    filters = []
    robust = next(
        (update(parameters[key]) for key, update in UPDATES.items() if key in parameters),
        None,
    )
    for name in names:
        intensity = parameters[f"q {name}"]
        model = MotionModel(
            name,
            axes=3,
            noise=(intensity, intensity, parameters.get(VERTICAL, intensity)),
        )
        variance = parameters.get("scale", 1.0) * SIGMA**2
        start = START_DEVIATIONS[: model.order - 1]
        filters.append(KalmanFilter(model, variance, start, robust))
    return (
        filters[0]
        if len(filters) == 1
        else IMMFilter(filters, [parameters[f"sojourn {name}"] for name in names])
    )


def _particle_filter(parameters: Parameters) -> TrackFilter:
    model = MotionModel("CV", axes=3, noise=parameters["q CV"])
    deviation = math.sqrt(parameters["scale"]) * SIGMA
    return ParticleFilter(
        model,
        deviation,
        START_DEVIATIONS[:1],
        parameters["degrees of freedom"],
        PARTICLES,
    )


def _log(low: float, high: float) -> FloatDistribution:
    return FloatDistribution(low, high, log=True)


_AVERAGE: dict[str, BaseDistribution] = {"window": IntDistribution(1, 13), "ratio": _log(1e-3, 0.5)}
_GAINS: dict[str, BaseDistribution] = {
    "g": FloatDistribution(0.05, 1.0),
    "h": FloatDistribution(0.005, 0.6),
}
_THESIS: dict[str, BaseDistribution] = {"q": _log(1e-4, 1e4), **_AVERAGE}
_START = {"window": 2, "ratio": 0.05}
_THESIS_START = {"q": 1.0, **_START}
_CV: dict[str, BaseDistribution] = {"q CV": _log(0.1, 1e3)}
_CA: dict[str, BaseDistribution] = {"q CA": _log(1e-3, 1e2)}
_SOJOURNS: dict[str, BaseDistribution] = {
    "sojourn CV": _log(1.0, 300.0),
    "sojourn CA": _log(1.0, 300.0),
}


def _sound(space: Mapping[str, Any], *names: str) -> Contender:
    """A `_sound_filter`; its tuning starts in the logarithmic middle of every range."""
    middle = {key: math.sqrt(values.low * values.high) for key, values in space.items()}
    return Contender(partial(_sound_filter, names), space, middle)


# As in the thesis, with the moving average.
THESIS: dict[str, Contender] = {
    "g-h": Contender(
        _gh_filter,
        _GAINS | _AVERAGE,
        {
            "g": 0.6,
            "h": 0.2,
            **_START,
        },
        averages=True,
    ),
    **{
        f"KF {name}": Contender(partial(_thesis_filter, name), _THESIS, _THESIS_START, True)
        for name in ("CV", "CA", "CJ")
    },
}

# Without averaging; R of the Gaussian noise known, continuous process noise, a prior of the start.
# All axes are treated alike, as by the g-h filter, except in the last one.
SOUND: dict[str, Contender] = {
    "IMM (CV, CA)": _sound(_CV | _CA | _SOJOURNS, "CV", "CA"),
    "CV": _sound(_CV, "CV"),
    "g-h, plain": Contender(_gh_filter, _GAINS, {"g": 0.6, "h": 0.2}),
    "CA": _sound(_CA, "CA"),
    "CJ": _sound({"q CJ": _log(1e-5, 1e1)}, "CJ"),
    "CV, own q of the height": _sound(_CV | {VERTICAL: _log(1e-3, 1e3)}, "CV"),
}
_STUDENT: dict[str, BaseDistribution] = {
    "degrees of freedom": _log(2.0, 50.0),
    "scale": _log(0.2, 1.5),
}
# One set of parameters for both noises; the process noise is that of the sound CV with Gaussian
# noise.
ROBUST: dict[str, Contender] = {
    "CV, Huber": _sound({"threshold": _log(1.0, 5.0)}, "CV"),
    "CV, Student-t": _sound(_STUDENT, "CV"),
    "CV, correntropy": _sound({"width": _log(1.0, 30.0)}, "CV"),
}

# Robust as well, but slow: on the data set only. The process noise is tuned, because particles are
# lost in manoeuvres that are rare under it.
_PARTICLES = {
    "degrees of freedom": 10.0,
    "scale": 0.8,
    "q CV": 60.0,
}
SLOW: dict[str, Contender] = {
    "particles, Student-t": Contender(
        _particle_filter,
        _STUDENT | {"q CV": _log(1.0, 1e3)},
        _PARTICLES,
        trials=16,
    )
}
# The IMM and the robust update of the Student-t CV, with the parameters that each has alone.
COMBINED = "IMM, Student-t"

CONTENDERS: dict[str, Contender] = {
    **THESIS,
    **SOUND,
    **ROBUST,
    **SLOW,
    COMBINED: Contender(partial(_sound_filter, ("CV", "CA")), {}, {}),
}
