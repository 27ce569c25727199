"""What the papers simulate and assume: Golubkov 2018 and 2020, Tsyganov 2019.

The filters know the start; alpha = beta.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env import Simulation, simulate
from studies.papers.ate import track_ate


@dataclass(frozen=True)
class Setting:
    """A simulated experiment of a paper."""

    # Citation key.
    paper: str
    # A scheme of `hybrid_env.parse_scheme`.
    scheme: str
    # State one tick before the first measurement, [x, vx, y, vy] [m, m/s].
    start: tuple[float, float, float, float]
    # Turn radii of the bank [m].
    radii: tuple[float, ...]
    # R [m^2] by the name of the setting.
    variances: dict[str, float]
    # Q [m^2/s^2].
    process_variance: float = 0.001
    # Options of `track_ate` of the published algorithm.
    ate: dict[str, Any] = field(default_factory=dict)
    alpha: float = 1e-3
    # Length of a tick [s].
    tau: float = 0.1

    @property
    def signed_radii(self) -> NDArray[np.float64]:
        """(M,) radii of the hypotheses [m]: positive to the left, negative to the right, 0 if
        straight.
        """
        return np.array([0.0, *self.radii, *(-radius for radius in self.radii)])

    @property
    def sides(self) -> NDArray[np.int64]:
        """(M,) type of each hypothesis: 0 straight, 1 left, -1 right."""
        return np.sign(self.signed_radii).astype(np.int64)

    def simulate(self, runs: int, seed: int, variance: float, **options: Any) -> Simulation:
        """Simulate runs with R [m^2]; options are those of `hybrid_env.simulate`."""
        known: dict[str, Any] = {
            "scheme": self.scheme,
            "start": self.start,
            "process_variance": self.process_variance,
            "measurement_variance": variance,
        }
        return simulate(**(known | options), runs=runs, seed=seed)

    def track(self, recording: Simulation, variance: float, **options: Any) -> Any:
        """Run ATE with R [m^2]; options are those of `track_ate`."""
        known: dict[str, Any] = {
            "start": self.start,
            "radii": self.radii,
            "process_variance": self.process_variance,
            "measurement_variance": variance,
            "alpha": self.alpha,
        }
        return track_ate(recording.measurements, recording.lengths, **(known | self.ate | options))

    def correct_types(self, tracks: Any, recording: Simulation) -> NDArray[np.bool_]:
        """(n, K) True where the decided type (straight, left or right) is correct."""
        return self.sides[tracks.decided] == np.sign(recording.signed_radii)


GOLUBKOV_2018 = Setting(
    "Golubkov 2018",
    "golubkov2018",
    (0.0, 0.0, 0.0, 2.0),
    tuple(float(radius) for radius in range(1, 11)),
    {"R1": 1.0, "R2": 0.1, "R3": 0.01},
)
# Published with a decimal comma in x0. After a decision, the estimates of the segment are
# recalculated from its first state but with the covariance of the decision tick, so that the data
# are used twice.
TSYGANOV_2019 = Setting(
    "Tsyganov 2019",
    "tsyganov2019",
    (0.0, 0.0, 0.0, 0.25),
    (5.0,),
    {"R = 0.01": 0.01, "R = 0.1": 0.1, "R = 1": 1.0},
    0.0,
    {"recalculation": "as_published"},
)
# The tested turn is p = 2, as in the experiment, not p = 1. The paper states neither alpha nor
# beta.
GOLUBKOV_2020 = Setting("Golubkov 2020", "golubkov2020", (0.0, 0.0, 0.0, 2.0), (5.0,), {"R": 0.1})
