"""The options of the environment with announced switches, checked on creation."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, IntArray, reject
from hybrid_env.core.memory import (
    SEGMENT_COLUMNS,
    TICK_NAMES,
    AnchorAwareBank,
    DenseBank,
    PublishedBank,
)
from hybrid_env.core.observation_row import OBSERVATIONS
from hybrid_env.limits import QuantityOrZero
from hybrid_env.model_options import ModelOptions as ModelOptions
from hybrid_env.noises import StudentNoise
from hybrid_env.observation import InnovationsLayout, Layout, RawLayout, StateLayout
from hybrid_env.scheme import FixedScheme, RandomScheme, Scheme, parse_scheme, segment_table


@dataclass(frozen=True, kw_only=True)
class WorldOptions(ModelOptions):
    """The options of `HybridTrackEnv`, which are keywords of `gym.make`: these and those of
    `ModelOptions`.

    Attributes:
        scheme: segments of an episode, as "random 4x20-60" or "L50r3 R75r5 S50". "random" is 6
            segments of 50 to 100 ticks, all modes equally likely. Also a key of `SCHEMES`, or a
            scheme object.
        bank: kind of the bank, "published", "anchor_aware" or "oracle". "published" treats the
            anchor as exact; "anchor_aware" includes the uncertainty of the anchor in the state of
            every turn, see `core.banks.anchor_aware`; "oracle" is the published bank anchored at
            the true state, an upper bound for evaluation that is not available in practice.
        reset_covariance: whether every segment starts with P := I, as published. Otherwise the
            covariance of the estimate is carried over. None means True for the published bank that
            follows the declared filter, and False otherwise.
        follow: what runs on after a decision, "declared" or "bank". "declared", as published: the
            filter of the declared hypothesis, whose estimate is the next anchor. "bank": all
            filters; the estimate and the next anchor are the mean of the posterior over all
            hypotheses, with its covariance (`core.banks.posterior`), so that a wrong decision costs
            its reward and nothing else.
        delay_cost: cost of a step, in units of the reward of a correct decision.
        correctness: "exact" requires the hypothesis, "type" only straight, left or right.
        evidence: a declaration counts once the posterior of a mode reaches this probability. Before
            it waits. With `correctness="type"` the posterior is that of straight, left or right.
            All hypotheses have equal priors at the switch. 0 lets every declaration count.
        actions: what can be declared, "all" hypotheses or "types". "all" waits or declares one of M
            hypotheses; "types" waits or declares straight, left or right, which is the most likely
            hypothesis of this type.
        observation: what is observed, "bank", "raw", "state" or "innovations". "bank" is the output
            of the bank; "raw" the measurement relative to the anchor, without the bank; "state" the
            true state and the true mode; "innovations" the whitened innovations, the time and the
            last decision, so that a decider has to sum up the evidence. Actions, rewards and
            episodes are the same with all of them, so that their difference is the worth of a bank,
            and of what cannot be observed.
        undecided: decision on a segment that ends undecided, "likeliest" or "keep". "likeliest" is
            the most likely hypothesis, "keep" the last decided mode, as in the papers.
    """

    switches = "announced"
    tick_names = TICK_NAMES
    hypothesis_field = "log_likelihood"

    scheme: Annotated[str | Scheme, parse_scheme] = "random"
    bank: Literal["published", "anchor_aware", "oracle"] = "published"
    reset_covariance: bool | None = None
    follow: Literal["declared", "bank"] = "declared"
    delay_cost: QuantityOrZero = 0.02
    correctness: Literal["exact", "type"] = "exact"
    evidence: Annotated[float, Interval(ge=0.0, le=1.0 - 1e-9)] = 0.0
    actions: Literal["all", "types"] = "all"
    observation: Literal["bank", "raw", "state", "innovations"] = "bank"
    undecided: Literal["likeliest", "keep"] = "likeliest"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.reset_covariance and self.bank == "oracle":
            raise reject(
                "reset_covariance", True, "False or None with bank='oracle', whose anchor is exact"
            )
        signed_radii = self.table[:, SEGMENT_COLUMNS.index("signed_radius")]
        of_scheme = {abs(float(radius)) for radius in signed_radii if radius}
        missing = sorted(of_scheme - set(self.radii)) if self.modes is None else []
        if self.correctness == "exact" and missing:
            shown = ", ".join(map(str, missing[:3])) + (", ..." if len(missing) > 3 else "")
            raise reject(
                "radii",
                self.radii,
                f"radii that include {shown} of the scheme, or correctness='type'",
            )
        self._check_ratios(of_scheme | set(self.radii))
        if self.decide_every > self.shortest_segment:
            allowed = f"at most {self.shortest_segment}, the length of the shortest segment"
            raise reject("decide_every", self.decide_every, allowed)

    def segment_reward(self, correct: ArrayLike, ticks: ArrayLike) -> FloatArray:
        """Return the rewards of segments, their waits included, see `core.announced`.

        Args:
            correct: (...,) whether the decisions are, by the option `correctness`.
            ticks: (...,) decision times since the switch.
        """
        reward: FloatArray = np.where(correct, 1.0, -1.0) - self.delay_cost * np.asarray(ticks)
        return reward

    @property
    def groups(self) -> IntArray:
        """Numbers (M,) that are equal where declaring either hypothesis is rewarded alike."""
        return self.types if self.correctness == "type" else np.arange(self.hypotheses)

    @property
    def bank_class(self) -> type:
        """Class of the bank: with sensors the axes of the published one are not independent, and
        the robust likelihood is that of both.
        """
        if self.modes is not None:
            return DenseBank
        together = self.sensors or isinstance(self.likelihood, StudentNoise)
        return AnchorAwareBank if together or self.bank == "anchor_aware" else PublishedBank

    @property
    def action_count(self) -> int:
        """Number of actions."""
        return 1 + (self.hypotheses if self.actions == "all" else len(self.type_names))

    @property
    def layout_class(self) -> type[Layout]:
        """Layout of the rows, by the option `observation`."""
        return {
            "bank": Layout,
            "raw": RawLayout,
            "state": StateLayout,
            "innovations": InnovationsLayout,
        }[self.observation]

    @property
    def table(self) -> FloatArray:
        """Segments in order, or the modes to draw from, see `scheme.segment_table`."""
        assert not isinstance(self.scheme, str)
        return segment_table(self.scheme, self.all_modes)

    def _lengths(self, longest: bool = True) -> list[int]:
        """Return the largest or the smallest length of every segment of an episode [ticks]."""
        if isinstance(self.scheme, FixedScheme):
            return [piece.length for piece in self.scheme.pieces]
        assert isinstance(self.scheme, RandomScheme)
        return [self.scheme.lengths[longest]] * self.scheme.segments

    @property
    def segments(self) -> int:
        """Number of segments of an episode."""
        return len(self._lengths())

    @property
    def longest_segment(self) -> int:
        """Length of the longest possible segment [ticks]."""
        return max(self._lengths())

    @property
    def shortest_segment(self) -> int:
        """Length of the shortest possible segment [ticks]."""
        return min(self._lengths(longest=False))

    @property
    def most_ticks(self) -> int:
        """Length of the longest possible episode [ticks]."""
        return sum(self._lengths())

    @property
    def longest_episode(self) -> int:
        """Largest number of steps of an episode: its decisions if every action waits."""
        return sum(-(-length // self.decide_every) for length in self._lengths())

    @property
    def longest_step(self) -> int:
        """Largest number of ticks of a step: to the end of a segment and to the next decision."""
        return self.longest_segment + self.decide_every

    def parameters(self) -> dict[str, Any]:
        """See `ModelOptions.parameters`."""
        default = self.bank == "published" and self.follow == "declared"
        parameters = super().parameters() | {
            "segments": self.segments,
            "reset_covariance": default if self.reset_covariance is None else self.reset_covariance,
            "oracle": self.bank == "oracle",
            "exact_anchor": self.bank != "anchor_aware",
            "exact": self.correctness == "exact",
            "merged": self.follow == "bank",
            "declare_type": self.actions == "types",
            "log_error_allowed": math.log1p(-self.evidence),
            "observation": OBSERVATIONS.index(self.observation),
            # 1 if those of both axes are equal.
            "axes": 2 if self.follow == "bank" else self.variances.size,
            "keep_undecided": self.undecided == "keep",
        }
        if isinstance(self.scheme, RandomScheme):
            parameters["random_scheme"] = True
            parameters["shortest"], parameters["longest"] = self.scheme.lengths
        return parameters
