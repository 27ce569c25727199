"""The options of the environment with unknown switch moments, checked on creation."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval

from hybrid_env.checks import AnyArray, FloatArray, IntArray, checked, reject, unknown
from hybrid_env.core.memory import TICK_NAMES, DenseImmBank, ImmBank
from hybrid_env.durations import (
    DRAWN,
    DurationLaw,
    Durations,
    ModeDurations,
    duration_probabilities,
    parse_durations,
    remaining_probabilities,
)
from hybrid_env.limits import QuantityOrZero, Ticks
from hybrid_env.model_options import ModelOptions
from hybrid_env.observation import Layout, QuickestLayout
from hybrid_env.scheme import RandomScheme, segment_table


def check_transitions(value: Any, names: Sequence[str]) -> str | tuple[tuple[float, ...], ...]:
    """Return a word, or a matrix as a tuple of rows. names: of the modes. Raises `ArgumentError`
    for other values.
    """
    if isinstance(value, str) and value in ("equal", "cycle", DRAWN):
        return value
    M = len(names)
    rows: Any = [row.split() for row in value.split(",")] if isinstance(value, str) else value
    if isinstance(value, Mapping) and all(isinstance(row, Mapping) for row in value.values()):
        for name in {*value, *(name for row in value.values() for name in row)} - {*names}:
            raise unknown("transitions", name, names)
        rows = [[value.get(row, {}).get(column, 0.0) for column in names] for row in names]
    with suppress(TypeError, ValueError):
        matrix = np.array(rows, float)
        if (
            matrix.shape == (M, M)
            and (matrix >= 0.0).all()
            and not matrix.diagonal().any()
            and np.allclose(matrix.sum(1), 1.0, rtol=0.0, atol=1e-9)
        ):
            return tuple(map(tuple, matrix.tolist()))
    allowed = (
        f"equal, cycle, drawn, or a ({M}, {M}) matrix with a zero diagonal and rows that sum to 1,"
        " also as a mapping of names of modes"
    )
    raise reject("transitions", value, allowed)


@dataclass(frozen=True, kw_only=True)
class QuickestOptions(ModelOptions):
    """The options of `HybridTrackQuickestEnv`, which are keywords of `gym.make`: these and
    `ModelOptions`.

    Attributes:
        ticks: length of an episode [ticks].
        durations: law of the duration of a segment, as "25 + geometric 50", see
            `hybrid_env.durations`. Also "geometric 75", "uniform 50-100", "drawn" for another law
            in every episode, or a law object.
        transitions: law of the next mode, "equal", "cycle", "drawn" or a matrix. With "equal" all
            other modes are equally likely; "cycle" is one after the other; "drawn" another law in
            every episode; an (M, M) matrix has the probabilities of the next mode (column) by the
            present one, with zeros on the diagonal, also as text: "0 0.9 0.1, 0.5 0 0.5, 1 0 0", or
            by names: {"straight": {"stop": 1.0}, ...}.
        start: begin of an episode, "known" or "random". "known" is a switch to a random mode, which
            the bank knows; "random" is a random moment of a segment whose mode the bank does not
            know.
        change_cost: cost of a change of the statement to a wrong mode, in units of the reward of a
            tick.
        hazard: probability of a switch per tick that the bank assumes, at most (M - 1) / M. All
            other modes then follow with equal probability. None is the inverse of the mean duration
            of each mode, with the probabilities of `transitions`; what is drawn is not known.
    """

    switches = "unknown"
    tick_names = tuple(name for name in TICK_NAMES if name != "anchor")
    hypothesis_field = "log_probability"

    ticks: Ticks = 600
    durations: Annotated[str | Durations, parse_durations] = "25 + geometric 50"
    transitions: str | Mapping[str, Mapping[str, float]] | tuple[tuple[float, ...], ...] = "equal"
    start: Literal["known", "random"] = "known"
    change_cost: QuantityOrZero = 5.0
    hazard: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [mode.name for mode in self.all_modes]
        object.__setattr__(self, "transitions", check_transitions(self.transitions, names))
        allowed = Annotated[float, Interval(ge=0.0, le=1.0 - 1.0 / self.hypotheses)] | None
        object.__setattr__(self, "hazard", checked("hazard", self.hazard, allowed))
        if len({*self.law_places.tolist()}) < len(self.laws):
            raise reject("durations", str(self.law), f"only laws of {', '.join(names)}")
        self._check_ratios(self.radii)
        if self.decide_every > self.ticks:
            most = f"at most {self.ticks}, the ticks of an episode"
            raise reject("decide_every", self.decide_every, most)

    @property
    def equally_likely(self) -> bool:
        """Whether the bank assumes one probability of a switch, to all other modes alike."""
        equal = self.transitions in ("equal", DRAWN)
        return self.hazard is not None or (equal and not isinstance(self.law, ModeDurations))

    @property
    def bank_class(self) -> type:
        """Class of the bank: the fast one needs equal transitions of straight motion and turns."""
        return ImmBank if self.modes is None and self.equally_likely else DenseImmBank

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
    def most_ticks(self) -> int:
        """Length of an episode [ticks]."""
        return self.ticks

    @property
    def longest_episode(self) -> int:
        """Number of steps of an episode."""
        return -(-self.ticks // self.decide_every)

    @property
    def longest_step(self) -> int:
        """Largest number of ticks of a step."""
        return self.decide_every

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
        if self.equally_likely:
            matrix = np.full((M, M), self.assumed_hazard / (M - 1))
            np.fill_diagonal(matrix, 1.0 - self.assumed_hazard)
            return matrix
        means = [self.laws[place].mean_duration for place in self.law_places]
        hazards = np.minimum(1.0 / np.array(means), 1.0 - 1.0 / M)
        return np.diag(1.0 - hazards) + hazards[:, None] * self.next_mode_matrix

    @property
    def table(self) -> FloatArray:
        """One row for each mode, see `scheme.segment_table`."""
        return segment_table(RandomScheme(), self.all_modes)

    @property
    def laws(self) -> tuple[DurationLaw, ...]:
        """The different laws of the durations."""
        law = self.law
        return tuple(of for _, of in law.laws) if isinstance(law, ModeDurations) else (law,)

    @property
    def law_places(self) -> IntArray:
        """The place of the law of every mode in `laws`, (M,)."""
        if not isinstance(self.law, ModeDurations):
            return np.zeros(self.hypotheses, np.int64)
        return np.array([self.law.place(mode) for mode in self.all_modes])

    @property
    def duration_laws(self) -> FloatArray:
        """Probabilities of 1, ..., `ticks` ticks, (2 K, ticks): of a first segment by each of K
        laws, and of other segments.
        """
        first = remaining_probabilities if self.start == "random" else duration_probabilities
        return np.stack(
            [of(law, self.ticks) for of in (first, duration_probabilities) for law in self.laws]
        )

    @property
    def next_mode_matrix(self) -> FloatArray:
        """Probabilities of the next mode (column) by the present one, (M, M); rows sum to 1."""
        if isinstance(self.transitions, tuple):
            return np.array(self.transitions)
        if self.transitions == "cycle":
            return np.roll(np.eye(self.hypotheses), 1, axis=1)
        return (1.0 - np.eye(self.hypotheses)) / (self.hypotheses - 1)

    def arrays(self) -> dict[str, AnyArray]:
        """See `ModelOptions.arrays`."""
        arrays = super().arrays()
        arrays["durations"] = np.cumsum(self.duration_laws, axis=1)
        arrays["transitions"] = self.transition_matrix
        arrays["law_places"] = self.law_places
        if self.transitions not in ("equal", DRAWN):
            arrays["order"] = self.next_mode_matrix
        return arrays

    def parameters(self) -> dict[str, Any]:
        """See `ModelOptions.parameters`."""
        stay, switch = self.transition_matrix[0, :2]
        return super().parameters() | {
            "start_known": self.start == "known",
            "duration_rows": 2 * len(self.laws),
            "order_rows": 0 if self.transitions in ("equal", DRAWN) else self.hypotheses,
            "drawn_modes": self.hypotheses if self.transitions == DRAWN else 0,
            "drawn_laws": 2 if str(self.durations) == DRAWN else 0,
            "stay_probability": stay,
            "switch_probability": switch,
        }
