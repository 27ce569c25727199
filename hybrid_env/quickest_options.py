"""The options of the environment with unknown switch moments, checked on creation."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval

from hybrid_env import durations as laws
from hybrid_env.checks import AnyArray, FloatArray, checked, reject
from hybrid_env.core.memory import TICK_NAMES, DenseImmBank, ImmBank
from hybrid_env.durations import DRAWN, Durations, parse_durations
from hybrid_env.limits import QuantityOrZero, Ticks
from hybrid_env.model_options import ModelOptions
from hybrid_env.observation import Layout, QuickestLayout
from hybrid_env.scheme import RandomScheme, segment_table


def check_order(order: Any, modes: int) -> str | tuple[tuple[float, ...], ...]:
    """Return a name, or a matrix as a tuple of rows. Raises `ArgumentError` for other values."""
    if isinstance(order, str) and order in ("equal", "cycle", DRAWN):
        return order
    allowed = (
        f"equal, cycle, drawn, or a ({modes}, {modes}) matrix with a zero diagonal and rows that"
        " sum to 1"
    )
    rows = [row.split() for row in order.split(",")] if isinstance(order, str) else order
    with suppress(TypeError, ValueError):
        matrix = np.array(rows, float)
        if (
            matrix.shape == (modes, modes)
            and (matrix >= 0.0).all()
            and not matrix.diagonal().any()
            and np.allclose(matrix.sum(1), 1.0, rtol=0.0, atol=1e-9)
        ):
            return tuple(map(tuple, matrix.tolist()))
    raise reject("order", order, allowed)


@dataclass(frozen=True, kw_only=True)
class QuickestOptions(ModelOptions):
    """The options of `HybridTrackQuickestEnv`, which are keywords of `gym.make`: these and
    `ModelOptions`.

    Attributes:
        ticks: length of an episode [ticks].
        durations: law of the duration of a segment, see `hybrid_env.durations`: "25 + geometric
            50", "geometric 75", "uniform 50-100", "drawn" for another law in every episode, or a
            law object.
        order: law of the next mode: "equal", all other modes equally likely; "cycle", straight,
            left turns, right turns, and again; or an (M, M) matrix of the probabilities of the next
            mode (column) by the present one, with zeros on the diagonal, also as text: "0 0.9 0.1,
            0.5 0 0.5, 1 0 0"; or "drawn", another one in every episode.
        start: "known" begins an episode at a switch to a random mode, which the bank knows;
            "random" begins at a random moment of a segment whose mode the bank does not know.
        change_cost: cost of a change of the statement to a wrong mode, in units of the reward of a
            tick.
        hazard: probability of a switch per tick that the bank assumes, at most (M - 1) / M; None is
            the inverse of the mean duration.
    """

    switches = "unknown"
    tick_names = tuple(name for name in TICK_NAMES if name != "anchor")
    hypothesis_field = "log_probability"

    ticks: Ticks = 600
    durations: Annotated[str | Durations, parse_durations] = "25 + geometric 50"
    order: str | tuple[tuple[float, ...], ...] = "equal"
    start: Literal["known", "random"] = "known"
    change_cost: QuantityOrZero = 5.0
    hazard: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "order", check_order(self.order, self.hypotheses))
        allowed = Annotated[float, Interval(ge=0.0, le=1.0 - 1.0 / self.hypotheses)] | None
        object.__setattr__(self, "hazard", checked("hazard", self.hazard, allowed))
        self._check_ratios(self.radii)

    @property
    def bank_class(self) -> type:
        """Class of the bank: modes of the user need all covariances."""
        return ImmBank if self.modes is None else DenseImmBank

    @property
    def layout_class(self) -> type[Layout]:
        """Layout of the rows."""
        return QuickestLayout

    @property
    def action_count(self) -> int:
        """Number of actions: one for each mode."""
        return self.hypotheses

    @property
    def segments(self) -> int:
        """Largest number of segments of an episode."""
        return self.ticks

    @property
    def longest_segment(self) -> int:
        """Length of the longest possible segment inside an episode [ticks]."""
        return self.ticks

    @property
    def longest_episode(self) -> int:
        """Number of steps of an episode."""
        return self.ticks

    @property
    def law(self) -> Durations:
        """Law of the duration of a segment."""
        assert not isinstance(self.durations, str)
        return self.durations

    @property
    def assumed_hazard(self) -> float:
        """Probability of a switch per tick that the bank assumes."""
        largest = 1.0 - 1.0 / self.hypotheses
        return min(1.0 / self.law.mean_duration, largest) if self.hazard is None else self.hazard

    @property
    def transition_matrix(self) -> FloatArray:
        """Transition probabilities that the bank assumes, (M, M); rows sum to 1."""
        M = self.hypotheses
        matrix = np.full((M, M), self.assumed_hazard / (M - 1))
        np.fill_diagonal(matrix, 1.0 - self.assumed_hazard)
        return matrix

    @property
    def table(self) -> FloatArray:
        """One row for each mode, see `scheme.segment_table`."""
        return segment_table(
            RandomScheme(), self.radii, None if self.modes is None else self.all_modes
        )

    @property
    def duration_laws(self) -> FloatArray:
        """Probabilities of 1, ..., `ticks` ticks, (4, ticks): of a first straight segment or
        turn, and of others.
        """
        first = (
            laws.remaining_probabilities if self.start == "random" else laws.duration_probabilities
        )
        law = self.law
        both = (law.straight, law.turns) if isinstance(law, laws.ModeDurations) else (law, law)
        return np.stack(
            [of(law, self.ticks) for of in (first, laws.duration_probabilities) for law in both]
        )

    @property
    def order_matrix(self) -> FloatArray:
        """Probabilities of the next mode (column) by the present one, (M, M); rows sum to 1."""
        if isinstance(self.order, tuple):
            return np.array(self.order)
        if self.order == "cycle":
            return np.roll(np.eye(self.hypotheses), 1, axis=1)
        return (1.0 - np.eye(self.hypotheses)) / (self.hypotheses - 1)

    def arrays(self) -> dict[str, AnyArray]:
        """See `ModelOptions.arrays`."""
        arrays = super().arrays()
        arrays["durations"] = np.cumsum(self.duration_laws, axis=1)
        arrays["transitions"] = self.transition_matrix
        if self.order not in ("equal", DRAWN):
            arrays["order"] = self.order_matrix
        return arrays

    def parameters(self) -> dict[str, Any]:
        """See `ModelOptions.parameters`."""
        stay, switch = self.transition_matrix[0, :2]
        return super().parameters() | {
            "start_known": self.start == "known",
            "order_rows": 0 if self.order in ("equal", DRAWN) else self.hypotheses,
            "drawn_modes": self.hypotheses if self.order == DRAWN else 0,
            "drawn_laws": 2 if str(self.durations) == DRAWN else 0,
            "stay_probability": stay,
            "switch_probability": switch,
        }
