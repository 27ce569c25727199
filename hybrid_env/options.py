"""The options of a world, checked when it is made."""

import dataclasses
import difflib
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import (
    check_choice,
    check_flag,
    check_number,
    check_positive,
    check_radii,
    noise_axes,
    reject,
)
from hybrid_env.core.kernel import BANKS
from hybrid_env.core.records import PARAMETERS
from hybrid_env.scheme import FixedScheme, Scheme, parse_scheme, segment_table


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """Everything of the model that `gym.make` takes as a keyword; the values are checked here.

    Attributes:
        scheme: segments of an episode: "random" (6 segments of 50 to 100 ticks, every mode equally
            likely), "random 4x20-60", "L50r3 R75r5 S50", a name of `SCHEMES`, or a scheme object.
        radii: turn radii of the bank [m], each as a left and as a right turn: M = 2 n + 1 hypotheses.
        speed: of the object at the start [m/s].
        heading: of the object at the start [rad], counter-clockwise from the x axis; None draws it.
        tau: length of a tick [s].
        process_variance: Q, added to each velocity every tick [m^2/s^2].
        measurement_variance: R of a measured coordinate [m^2], one number or (x, y).
        outliers: share of measurements, below 1, with five times the deviation (variance 25 R), of which the
            bank does not know.
        initial_error: (variance of the first estimate's position over R, variance of its velocity
            [m^2/s^2]), both normal; 0 starts at the true state.
        bank: "published" takes the anchor as exact; "anchor_aware" has its uncertainty in the state of every
            turn, see `anchor_aware`; "oracle" is the published bank anchored at the true state, a bound for
            evaluation that nobody has in practice.
        reset_covariance: True starts every segment with P := I, as published; False keeps the covariance of
            the chosen filter. None is True for the published bank and False for the others.
        delay_cost: cost of a step, in units of the reward of a right decision.
        correctness: "exact" asks for the hypothesis, "type" for straight, left or right only.
        actions: "all" waits or declares one of M hypotheses; "best" waits or declares the likeliest.
        undecided: a segment that ends undecided is decided for the "likeliest" hypothesis, or does
            "keep" the mode decided last, as in the papers.
    """

    scheme: str | Scheme = "random"
    radii: tuple[float, ...] = (5.0,)
    speed: float = 2.0
    heading: float | None = None
    tau: float = 0.1
    process_variance: float = 0.001
    measurement_variance: float | tuple[float, float] = 0.1
    outliers: float = 0.0
    initial_error: float | tuple[float, float] = (0.3, 0.02)
    bank: Literal["published", "anchor_aware", "oracle"] = "published"
    reset_covariance: bool | None = None
    delay_cost: float = 0.02
    correctness: Literal["exact", "type"] = "exact"
    actions: Literal["all", "best"] = "all"
    undecided: Literal["likeliest", "keep"] = "likeliest"

    def __post_init__(self) -> None:
        fix = object.__setattr__
        fix(self, "scheme", parse_scheme(self.scheme))
        fix(self, "radii", tuple(check_radii("radii", self.radii).tolist()))
        for name in ("speed", "tau"):
            fix(self, name, check_positive(name, getattr(self, name)))
        for name in ("process_variance", "delay_cost"):
            fix(self, name, check_positive(name, getattr(self, name), allow_zero=True))
        if self.heading is not None:
            fix(self, "heading", check_number("heading", self.heading, "a finite angle [rad] or None"))
        noise_axes(self.measurement_variance)
        if check_positive("outliers", self.outliers, allow_zero=True) >= 1.0:
            raise reject("outliers", self.outliers, "a number from 0 to below 1")
        fix(self, "initial_error", self._check_initial_error())
        check_choice("bank", self.bank, BANKS)
        if self.reset_covariance is not None:
            check_flag("reset_covariance", self.reset_covariance)
        if self.reset_covariance and self.bank == "oracle":
            raise reject("reset_covariance", True, "False or None with bank='oracle', which has no doubt")
        check_choice("correctness", self.correctness, ("exact", "type"))
        check_choice("actions", self.actions, ("all", "best"))
        check_choice("undecided", self.undecided, ("likeliest", "keep"))
        if self.correctness == "exact":
            missing = {abs(float(row[0])) for row in self.table if row[0]} - set(self.radii)
            if missing:
                raise reject(
                    "radii", self.radii, f"the scheme's radii {sorted(missing)} too, or correctness='type'"
                )

    def _check_initial_error(self) -> tuple[float, float]:
        value = self.initial_error
        if np.ndim(value) == 0:
            if isinstance(value, bool) or value != 0:
                raise reject("initial_error", value, "(position variance over R, velocity variance) or 0")
            return 0.0, 0.0
        if not isinstance(value, (tuple, list, np.ndarray)) or len(value) != 2:
            raise reject("initial_error", value, "(position variance over R, velocity variance) or 0")
        position, velocity = (check_positive("initial_error", item, allow_zero=True) for item in value)
        return position, velocity

    @classmethod
    def of(cls, **options: Any) -> "WorldOptions":
        """The options of keywords, with a one-line error for a name that does not exist."""
        names = [field.name for field in dataclasses.fields(cls)]
        for name, value in options.items():
            if name not in names:
                close = difflib.get_close_matches(name, names, 1)
                hint = f"did you mean {close[0]!r}? " if close else ""
                raise TypeError(
                    f"option {name}={value!r} is unknown: {hint}expected one of {', '.join(names)}"
                )
        return cls(**options)

    @property
    def hypotheses(self) -> int:
        """M, the number of hypotheses."""
        return 2 * len(self.radii) + 1

    @property
    def action_count(self) -> int:
        """Number of actions."""
        return 2 if self.actions == "best" else self.hypotheses + 1

    @property
    def variances(self) -> NDArray[np.float64]:
        """R of each distinct noise axis [m^2], (1,) or (2,)."""
        return noise_axes(self.measurement_variance)

    @property
    def table(self) -> NDArray[np.float64]:
        """Segments in order or to draw from, see `scheme.segment_table`."""
        assert not isinstance(self.scheme, str)
        return segment_table(self.scheme, self.radii)

    @property
    def longest_segment(self) -> int:
        """Ticks of the longest segment that can occur."""
        assert not isinstance(self.scheme, str)
        if isinstance(self.scheme, FixedScheme):
            return max(piece.length for piece in self.scheme.pieces)
        return self.scheme.lengths[1]

    @property
    def segments(self) -> int:
        """Segments of an episode."""
        assert not isinstance(self.scheme, str)
        return len(self.scheme.pieces) if isinstance(self.scheme, FixedScheme) else self.scheme.segments

    def parameters(self) -> NDArray[Any]:
        """The one record that the kernel reads."""
        assert not isinstance(self.scheme, str)
        assert isinstance(self.initial_error, tuple)
        record = np.zeros(1, PARAMETERS)
        for name in ("tau", "process_variance", "speed", "delay_cost", "segments", "outliers"):
            record[name] = getattr(self, name)
        record["heading"] = math.nan if self.heading is None else self.heading
        record["initial_position"], record["initial_velocity"] = self.initial_error
        default = self.bank == "published"
        record["reset_covariance"] = default if self.reset_covariance is None else self.reset_covariance
        record["oracle"] = self.bank == "oracle"
        record["exact"] = self.correctness == "exact"
        record["action_count"] = self.action_count
        record["declare_best"] = self.actions == "best"
        record["keep_undecided"] = self.undecided == "keep"
        record["process_deviation"] = math.sqrt(self.process_variance)
        record["deviation_x"], record["deviation_y"] = np.sqrt(self.variances[[0, -1]])
        record["variance_x"], record["variance_y"] = self.variances[[0, -1]]
        record["log_noise"] = np.log(self.variances).mean()
        record["noise_whitener"] = np.exp(-0.5 * record["log_noise"])
        record["radii_count"], record["axes"] = len(self.radii), self.variances.size
        if not isinstance(self.scheme, FixedScheme):
            record["random_scheme"] = True
            record["shortest"], record["longest"] = self.scheme.lengths
        return record
