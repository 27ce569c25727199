"""The results as tables and findings."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.papers.novospaskyi.filters import COMBINED, ROBUST, SOUND, THESIS
from baselines.papers.novospaskyi.published import (
    METRICS,
    PARAMETERS,
    TABLES,
    TEST_ERRORS,
    UNFILTERED,
    memory,
    steady_gains,
)
from baselines.papers.novospaskyi.radars import NOISES, PERIOD, RADARS, SIGMA, Noise
from baselines.papers.reproduction import Cell, Finding, paired_ratio, study_interval, table_row

FloatArray = NDArray[np.float64]

LIMIT_CV = "KF CV, R = 0"
"""KF CV with the published parameters but hardly any R."""

NOISE_NAMES: dict[Noise, str] = {"gaussian": "Gaussian noise", "levy": "Levy noise"}
POSITION, VELOCITY = 0, 2
"""Indices of the RMSE of position and velocity in `METRICS`."""

ORDERED = ("IMM (CV, CA)", "CV", "CA", "g-h, plain", "CJ")


@dataclass(frozen=True)
class Results:
    """Everything that was measured.

    Attributes:
        errors: (runs, F, 4) of each filter on F test flights, by noise and name; the values are those of
            `published.METRICS`. Names of `as_published` have the published parameters.
        parameters: tuned parameters by noise and name.
    """

    errors: dict[Noise, dict[str, FloatArray]]
    parameters: dict[Noise, dict[str, dict[str, Any]]]


def as_published(name: str) -> str:
    """Name of a filter of the thesis with its published parameters."""
    return f"{name}, published parameters"


def cells(results: Results, seed: int) -> tuple[Cell, ...]:
    """Values of all tables, with the interval of a study with as many test flights.

    Args:
        results: of the study.
        seed: of the resampling.
    """
    tables = {
        "{table}": {name: name for name in (UNFILTERED, *THESIS)},
        "{table}, with the published parameters": {name: as_published(name) for name in THESIS},
        "Sound settings, {noise}": {name: name for name in (*SOUND, *ROBUST, COMBINED)},
    }
    made: list[Cell] = []
    for title, rows in tables.items():
        for noise in NOISES:
            table = title.format(table=TABLES[noise], noise=NOISE_NAMES[noise])
            for row, name in rows.items():
                errors = results.errors[noise][name]
                flights = errors.shape[1]
                interval = study_interval(errors.reshape(-1, 4), lambda means: means, seed, flights)
                published = TEST_ERRORS[noise].get(row, (np.nan,) * 4)
                note = f"The interval contains 95 % of studies with {flights} test flights."
                made += table_row(table, row, METRICS, published, interval, 2, note)
    return tuple(made)


def findings(results: Results, seed: int, flights: int, training: int) -> tuple[Finding, ...]:
    """Results beyond the tables.

    Args:
        results: of the study.
        seed: of the resampling.
        flights: number of flights.
        training: number of flights for tuning.
    """
    runs = len(results.errors["gaussian"][UNFILTERED])
    made = [
        Finding("flights", f"{flights}: {training} to tune, {flights - training} to test, {runs} noise seeds")
    ]
    for noise in NOISES:
        made += [_unfiltered(results, noise), *_orders(results, noise)]
    made += [*_anomaly(results), *_sound(results, seed), *_robust(results, seed)]
    made += [
        Finding(f"tuned parameters, {NOISE_NAMES[noise]}: {name}", _text(results.parameters[noise][name]))
        for noise in NOISES
        for name in (*THESIS, *SOUND)
    ]
    made += [
        Finding(f"tuned parameters, both noises: {name}", _text(results.parameters["levy"][name]))
        for name in ROBUST
    ]
    return tuple(made)


def _text(parameters: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in parameters.items())


def _means(errors: dict[str, FloatArray], metric: int) -> dict[str, float]:
    return {name: float(values[..., metric].mean()) for name, values in errors.items()}


def _unfiltered(results: Results, noise: Noise) -> Finding:
    ours = results.errors[noise][UNFILTERED].mean((0, 1))
    deviations = 100.0 * (ours / np.array(TEST_ERRORS[noise][UNFILTERED]) - 1.0)
    parts = (f"{metric} {value:+.1f} %" for metric, value in zip(METRICS, deviations, strict=True))
    return Finding(f"unfiltered against the published values, {NOISE_NAMES[noise]}", ", ".join(parts))


def _ascending(values: dict[str, float], unit: str) -> str:
    names = sorted(values, key=lambda name: values[name])
    return ", ".join(f"{name} {values[name]:.2f} {unit}" for name in names)


def _orders(results: Results, noise: Noise) -> list[Finding]:
    """Filters of the thesis in the order of their errors, and the published order."""
    made = []
    for metric, unit in ((POSITION, "m"), (VELOCITY, "m/s")):
        ours = _means({name: results.errors[noise][name] for name in THESIS}, metric)
        theirs = {name: TEST_ERRORS[noise][name][metric] for name in THESIS}
        label = f"order by {METRICS[metric].partition(',')[0]}, {NOISE_NAMES[noise]}"
        made.append(Finding(label, _ascending(ours, unit), _ascending(theirs, unit)))
    return made


def _anomaly(results: Results) -> list[Finding]:
    """KF CV with its published parameters, and the gains that they give."""
    made = []
    for noise in NOISES:
        shown = [results.errors[noise][name] for name in (as_published("KF CV"), LIMIT_CV, "KF CV")]
        velocities, positions = (
            [values[..., metric].mean() for values in shown] for metric in (VELOCITY, POSITION)
        )
        made.append(
            Finding(
                f"KF CV with the published R and Q, {NOISE_NAMES[noise]}",
                "velocity RMSE {:.0f} m/s, in the limit R = 0 {:.0f} m/s, with the true R {:.1f} m/s; "
                "position RMSE {:.1f}, {:.1f} and {:.1f} m".format(*velocities, *positions),
                "velocity RMSE {2:.0f} m/s, position RMSE {0:.1f} m".format(*TEST_ERRORS[noise]["KF CV"]),
            )
        )
        parameters = PARAMETERS[noise]["KF CV"]
        for label, variance in (("published R", parameters["variances"][0]), ("true R", SIGMA**2)):
            g, h = steady_gains(variance, parameters["q"], PERIOD / RADARS)
            made.append(
                Finding(
                    f"KF CV gains on x, published Q, {label} = {variance:.3g} m^2, {NOISE_NAMES[noise]}",
                    f"position {g:.4f}, velocity {h:.4f} / t; a velocity error is multiplied by up to "
                    f"{memory(g, h):.4f} at every measurement (1 and 2 / t would keep it for ever)",
                )
            )
    return made


def _share(errors: FloatArray, others: FloatArray, seed: int) -> str:
    ratio = paired_ratio(errors[..., POSITION], others[..., POSITION], seed)
    return "{:.3f} [{:.3f}, {:.3f}]".format(*ratio)


def _sound(results: Results, seed: int) -> list[Finding]:
    errors = results.errors["gaussian"]
    start = ", ".join(
        f"{name} {errors[name][..., VELOCITY].mean():.2f} m/s" for name in ("KF CA", "CA", "g-h")
    )
    return [
        Finding(
            "sound CV: position RMSE as a share of no filter, Gaussian noise",
            _share(errors["CV"], errors[UNFILTERED], seed),
        ),
        Finding(
            "sound settings: order by position RMSE, Gaussian noise",
            _ascending(_means({name: errors[name] for name in ORDERED}, POSITION), "m"),
        ),
        Finding("the lead of g-h in velocity rests on P0 = 10000 I: CA with it, CA with a prior, g-h", start),
    ]


def _robust(results: Results, seed: int) -> list[Finding]:
    plain = {**dict.fromkeys(ROBUST, "CV"), COMBINED: "IMM (CV, CA)"}
    return [
        Finding(
            f"{name}: position RMSE as a share of the plain {other} tuned on {NOISE_NAMES[noise]}",
            _share(results.errors[noise][name], results.errors[noise][other], seed),
        )
        for name, other in plain.items()
        for noise in NOISES
    ]
