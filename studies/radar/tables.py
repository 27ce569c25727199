"""The published values, tables 3.1 to 3.6 of Novospaskyi 2025, and the results as tables and
findings.

Why KF CV has velocity errors of hundreds of metres per second in the thesis: its tuned R is about
1e-9 m^2, where the noise has 156 m^2. With discrete process noise and R / Q towards 0, the gains of
position and velocity approach 1 and 2 / t: v' = 2 (z_k - z_{k-1}) / t - v. The velocity error
changes sign at every measurement instead of decaying, and all the noise is summed. The position
error, which alone was tuned, hardly shows it.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.papers.reproduction import (
    Cell,
    Finding,
    both_intervals,
    paired_ratio,
    study_interval,
    table_row,
)
from studies.radar.filters import COMBINED, ROBUST, SOUND, THESIS
from studies.radar.radars import NOISES, PERIOD, RADARS, SIGMA, Noise

FloatArray = NDArray[np.float64]

PAPER = "Novospaskyi 2025"
METRICS = ("position RMSE, m", "position MAE, m", "velocity RMSE, m/s", "velocity MAE, m/s")
UNFILTERED = "no filter"
TABLES: dict[Noise, str] = {
    "gaussian": "Table 3.5, Gaussian noise",
    "levy": "Table 3.6, Levy noise",
}

# Tables 3.5 and 3.6: errors of the test flights, in the order of `METRICS`.
TEST_ERRORS: dict[Noise, dict[str, tuple[float, float, float, float]]] = {
    "gaussian": {
        UNFILTERED: (12.512, 9.930, 24.042, 22.327),
        "g-h": (11.437, 8.420, 8.259, 5.230),
        "KF CV": (16.929, 12.099, 433.265, 300.787),
        "KF CA": (9.885, 7.867, 8.748, 6.348),
        "KF CJ": (12.052, 9.465, 12.775, 8.473),
    },
    "levy": {
        UNFILTERED: (41.798, 20.449, 24.042, 22.327),
        "g-h": (31.499, 18.396, 13.075, 7.675),
        "KF CV": (35.511, 20.397, 459.790, 313.543),
        "KF CA": (29.365, 19.008, 14.161, 9.269),
        "KF CJ": (31.439, 19.797, 19.585, 12.927),
    },
}

# Tables 3.1 to 3.4: tuned parameters. `variances` is the diagonal of R [m^2], `q` its sigma_q;
# `window` and `ratio` (its alpha) are those of the moving average, with the weight ratio^i for a
# measurement i scans old.
PARAMETERS: dict[Noise, dict[str, dict[str, Any]]] = {
    "gaussian": {
        "g-h": {
            "g": 0.737,
            "h": 0.316,
            "window": 2,
            "ratio": 0.03,
        },
        "KF CV": {
            "variances": (9e-10, 1.5e-9, 2e-4),
            "q": 0.003,
            "window": 2,
            "ratio": 0.05,
        },
        "KF CA": {
            "variances": (0.435, 0.725, 96658.6),
            "q": 0.574,
            "window": 10,
            "ratio": 0.01,
        },
        "KF CJ": {
            "variances": (0.008, 0.013, 1771.7),
            "q": 0.008,
            "window": 8,
            "ratio": 0.001,
        },
    },
    "levy": {
        "g-h": {
            "g": 0.490,
            "h": 0.163,
            "window": 13,
            "ratio": 0.05,
        },
        "KF CV": {
            "variances": (1.27e-4, 6.33e-5, 2.53e-4),
            "q": 0.006,
            "window": 3,
            "ratio": 0.3,
        },
        "KF CA": {
            "variances": (52233.5, 26116.7, 104466.9),
            "q": 4.833,
            "window": 13,
            "ratio": 0.05,
        },
        "KF CJ": {
            "variances": (52233.5, 26116.7, 104466.9),
            "q": 1.274,
            "window": 12,
            "ratio": 0.05,
        },
    },
}
BY_CONSTRUCTION = "noise and averaging were chosen from this row"

# KF CV with the published parameters but hardly any R.
LIMIT_CV = "KF CV, R = 0"
NOISE_NAMES: dict[Noise, str] = {"gaussian": "Gaussian noise", "levy": "Levy noise"}
# Indices of the RMSE of position and velocity in `METRICS`.
POSITION, VELOCITY = 0, 2
ORDERED = ("IMM (CV, CA)", "CV", "CA", "g-h, plain", "CJ")


@dataclass(frozen=True)
class Results:
    """Everything that was measured, by noise and name; names of `as_published` have the
    published parameters.
    """

    # (runs, F, 4) on F test flights, in the order of `METRICS`
    errors: dict[Noise, dict[str, FloatArray]]
    # Tuned.
    parameters: dict[Noise, dict[str, dict[str, Any]]]


def as_published(name: str) -> str:
    """Name of a filter of the thesis with its published parameters."""
    return f"{name}, published parameters"


def steady_gains(
    variance: float,
    process_variance: float,
    step: float,
) -> tuple[float, float]:
    """Constant gains g and h that a CV Kalman filter with discrete process noise reaches, Kalata
    1984, with R of one axis [m^2] and the variance [m^2/s^4] of the acceleration that is constant
    in a step [s].
    """
    index = math.sqrt(process_variance / variance) * step**2
    root = 4.0 / (4.0 + index + math.sqrt(8.0 * index + index**2))
    return 1.0 - root**2, 2.0 * (1.0 - root) ** 2


def memory(g: float, h: float) -> float:
    """Largest magnitude of an eigenvalue of the error of a g-h filter; at 1 an error never
    decays.
    """
    # Of position, and velocity times the step.
    error = np.array([[1.0 - g, 1.0 - g], [-h, 1.0 - h]])
    return float(np.abs(np.linalg.eigvals(error)).max())


def cells(results: Results, seed: int) -> tuple[Cell, ...]:
    """Values of all tables, with the interval of a study with as many test flights; `seed`: of
    the resampling.
    """
    tables = {
        "{table}": {name: name for name in (UNFILTERED, *THESIS)},
        "{table}, with the published parameters": {name: as_published(name) for name in THESIS},
        "Sound settings, {noise}": {name: name for name in (*SOUND, *ROBUST, COMBINED)},
    }
    made: list[Cell] = []
    for (title, rows), noise in itertools.product(tables.items(), NOISES):
        table = title.format(table=TABLES[noise], noise=NOISE_NAMES[noise])
        for row, name in rows.items():
            errors = results.errors[noise][name]
            flights = errors.shape[1]
            of_study = study_interval(
                errors.reshape(-1, 4),
                lambda means: means,
                seed,
                flights,
            )
            of_means = both_intervals(errors.mean(0), lambda means: means, seed, flights)[3:]
            published = TEST_ERRORS[noise].get(row, (np.nan,) * 4)
            note = f"The interval contains 95 % of studies with {flights} test flights."
            excuses = dict.fromkeys(METRICS, BY_CONSTRUCTION) if row == UNFILTERED else None
            made += table_row(
                table,
                row,
                METRICS,
                published,
                (*of_study, *of_means),
                2,
                note,
                excuses,
            )
    return tuple(made)


def findings(
    results: Results,
    seed: int,
    flights: int,
    training: int,
) -> tuple[Finding, ...]:
    """Results beyond the tables; `training` of the flights are for tuning."""
    runs = len(results.errors["gaussian"][UNFILTERED])
    made = [
        Finding(
            "flights",
            f"{flights}: {training} to tune, {flights - training} to test, {runs} noise seeds",
        )
    ]
    for noise in NOISES:
        made += [_unfiltered(results, noise), *_orders(results, noise)]
    made += [*_anomaly(results), *_sound(results, seed)]
    tuned = [(noise, NOISE_NAMES[noise], name) for noise in NOISES for name in (*THESIS, *SOUND)]
    for noise, label, name in (*tuned, *(("levy", "both noises", name) for name in ROBUST)):
        text = ", ".join(
            f"{key} {value:.4g}" for key, value in results.parameters[noise][name].items()
        )
        made.append(Finding(f"tuned parameters, {label}: {name}", text))
    return tuple(made)


def _unfiltered(results: Results, noise: Noise) -> Finding:
    ours = results.errors[noise][UNFILTERED].mean((0, 1))
    deviations = 100.0 * (ours / np.array(TEST_ERRORS[noise][UNFILTERED]) - 1.0)
    parts = (f"{metric} {value:+.1f} %" for metric, value in zip(METRICS, deviations, strict=True))
    return Finding(
        f"unfiltered against the published values, {NOISE_NAMES[noise]}",
        ", ".join(parts),
    )


def _ascending(values: dict[str, float], unit: str) -> str:
    return ", ".join(
        f"{name} {values[name]:.2f} {unit}" for name in sorted(values, key=values.__getitem__)
    )


def _orders(results: Results, noise: Noise) -> list[Finding]:
    """Filters of the thesis in the order of their errors, and the published order."""
    made = []
    for metric, unit in (
        (POSITION, "m"),
        (VELOCITY, "m/s"),
    ):
        errors = {name: results.errors[noise][name][..., metric] for name in THESIS}
        theirs = {name: TEST_ERRORS[noise][name][metric] for name in THESIS}
        label = f"order by {METRICS[metric].partition(',')[0]}, {NOISE_NAMES[noise]}"
        ours = {name: float(values.mean()) for name, values in errors.items()}
        made.append(Finding(label, _ascending(ours, unit), _ascending(theirs, unit)))
        runs = {name: values.mean(1) for name, values in errors.items()}
        shares = [
            f"{first} before {second} {np.sum(runs[first] < runs[second])} of {len(runs[first])}"
            for first, second in itertools.pairwise(sorted(theirs, key=theirs.__getitem__))
        ]
        made.append(Finding(f"{label}: noise seeds with each published pair", ", ".join(shares)))
    return made


def _anomaly(results: Results) -> list[Finding]:
    """KF CV with its published parameters, and the gains that they give."""
    made = []
    for noise in NOISES:
        shown = [results.errors[noise][name] for name in (as_published("KF CV"), LIMIT_CV, "KF CV")]
        velocities, positions = (
            [values[..., metric].mean() for values in shown] for metric in (VELOCITY, POSITION)
        )
        text = (
            "velocity RMSE {:.0f} m/s, in the limit R = 0 {:.0f} m/s, with the true R {:.1f} m/s; "
            "position RMSE {:.1f}, {:.1f} and {:.1f} m".format(*velocities, *positions)
        )
        claim = "velocity RMSE {2:.0f} m/s, position RMSE {0:.1f} m".format(
            *TEST_ERRORS[noise]["KF CV"]
        )
        made.append(Finding(f"KF CV with the published R and Q, {NOISE_NAMES[noise]}", text, claim))
        parameters = PARAMETERS[noise]["KF CV"]
        for label, variance in (
            ("published R", parameters["variances"][0]),
            ("true R", SIGMA**2),
        ):
            g, h = steady_gains(
                variance,
                parameters["q"],
                PERIOD / RADARS,
            )
            text = (
                f"position {g:.4f}, velocity {h:.4f} / t; a velocity error is multiplied by up to "
                f"{memory(g, h):.4f} at every measurement (1 and 2 / t would keep it for ever)"
            )
            name = (
                f"KF CV gains on x, published Q, {label} = {variance:.3g} m^2, {NOISE_NAMES[noise]}"
            )
            made.append(Finding(name, text))
    return made


def _sound(results: Results, seed: int) -> list[Finding]:
    """Sound settings and robust filters, beside what they are compared with."""

    def share(
        noise: Noise,
        name: str,
        other: str,
    ) -> str:
        of, others = (results.errors[noise][key][..., POSITION] for key in (name, other))
        return "{:.3f} [{:.3f}, {:.3f}]".format(*paired_ratio(of, others, seed))

    errors = results.errors["gaussian"]
    start = ", ".join(
        f"{name} {errors[name][..., VELOCITY].mean():.2f} m/s" for name in ("KF CA", "CA", "g-h")
    )
    order = _ascending({name: float(errors[name][..., POSITION].mean()) for name in ORDERED}, "m")
    made = [
        Finding(
            "sound CV: position RMSE as a share of no filter, Gaussian noise",
            share("gaussian", "CV", UNFILTERED),
        ),
        Finding("sound settings: order by position RMSE, Gaussian noise", order),
        Finding(
            "the lead of g-h in velocity rests on P0 = 10000 I: CA with it, CA with a prior, g-h",
            start,
        ),
    ]
    plain = {**dict.fromkeys(ROBUST, "CV"), COMBINED: "IMM (CV, CA)"}
    for (name, other), noise in itertools.product(plain.items(), NOISES):
        label = (
            f"{name}: position RMSE as a share of the plain {other} tuned on {NOISE_NAMES[noise]}"
        )
        made.append(Finding(label, share(noise, name, other)))
    return made
