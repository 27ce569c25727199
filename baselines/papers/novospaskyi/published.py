"""Published values of Novospaskyi 2025, tables 3.1 to 3.6, and why KF CV has the velocity errors in them.

Errors of hundreds of metres per second: the tuned R of KF CV is about 1e-9 m^2, where the noise has 156 m^2.
With discrete process noise and R / Q towards 0, the gains of position and velocity approach 1 and 2 / t. The
estimate then follows every measurement, and the velocity becomes v' = 2 (z_k - z_{k-1}) / t - v: its error
changes sign at every measurement instead of decaying, and all the noise is summed. The position error, which
alone was tuned, hardly shows it.
"""

import math
from typing import Any

import numpy as np

from baselines.papers.novospaskyi.radars import Noise

PAPER = "Novospaskyi 2025"
METRICS = ("position RMSE, m", "position MAE, m", "velocity RMSE, m/s", "velocity MAE, m/s")
UNFILTERED = "no filter"
FILTERS = ("g-h", "KF CV", "KF CA", "KF CJ")
TABLES: dict[Noise, str] = {"gaussian": "Table 3.5, Gaussian noise", "levy": "Table 3.6, Levy noise"}

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
"""Tables 3.5 and 3.6: errors of the test flights, in the order of `METRICS`."""

PARAMETERS: dict[Noise, dict[str, dict[str, Any]]] = {
    "gaussian": {
        "g-h": {"g": 0.737, "h": 0.316, "window": 2, "ratio": 0.03},
        "KF CV": {"variances": (9e-10, 1.5e-9, 2e-4), "q": 0.003, "window": 2, "ratio": 0.05},
        "KF CA": {"variances": (0.435, 0.725, 96658.6), "q": 0.574, "window": 10, "ratio": 0.01},
        "KF CJ": {"variances": (0.008, 0.013, 1771.7), "q": 0.008, "window": 8, "ratio": 0.001},
    },
    "levy": {
        "g-h": {"g": 0.490, "h": 0.163, "window": 13, "ratio": 0.05},
        "KF CV": {"variances": (1.27e-4, 6.33e-5, 2.53e-4), "q": 0.006, "window": 3, "ratio": 0.3},
        "KF CA": {"variances": (52233.5, 26116.7, 104466.9), "q": 4.833, "window": 13, "ratio": 0.05},
        "KF CJ": {"variances": (52233.5, 26116.7, 104466.9), "q": 1.274, "window": 12, "ratio": 0.05},
    },
}
"""Tables 3.1 to 3.4: tuned parameters. `variances` is the diagonal of R [m^2], `q` its sigma_q; `window`
and `ratio` (its alpha) are those of the moving average, with the weight ratio^i for a measurement i scans
old."""


def steady_gains(variance: float, process_variance: float, step: float) -> tuple[float, float]:
    """Constant gains that a CV Kalman filter with discrete process noise reaches. Kalata 1984.

    Args:
        variance: R of one axis [m^2].
        process_variance: of the acceleration that is constant in a step [m^2/s^4].
        step: time between measurements [s].

    Returns:
        The position gain g and the velocity gain times the step, h, as those of the g-h filter.
    """
    index = math.sqrt(process_variance / variance) * step**2
    root = 4.0 / (4.0 + index + math.sqrt(8.0 * index + index**2))
    return 1.0 - root**2, 2.0 * (1.0 - root) ** 2


def without_noise(parameters: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a filter of the thesis, with R a millionth: the limit of gains 1 and 2 / t."""
    return parameters | {"variances": tuple(1e-6 * variance for variance in parameters["variances"])}


def memory(g: float, h: float) -> float:
    """Largest magnitude of an eigenvalue of the error of a g-h filter; at 1 an error never decays."""
    error = np.array([[1.0 - g, 1.0 - g], [-h, 1.0 - h]])  # of position, and velocity times the step
    return float(np.abs(np.linalg.eigvals(error)).max())
