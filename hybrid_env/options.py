"""The options of a world, checked on creation."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import check_choice, check_flag, reject
from hybrid_env.core.kernels import BANKS
from hybrid_env.core.records import PARAMETERS, SEGMENT_COLUMNS
from hybrid_env.limits import check_ratios, check_within
from hybrid_env.model_options import ModelOptions
from hybrid_env.scheme import FixedScheme, Scheme, parse_scheme, segment_table

CHOICES = {
    "bank": tuple(BANKS),
    "follow": ("declared", "bank"),
    "correctness": ("exact", "type"),
    "actions": ("all", "best"),
    "undecided": ("likeliest", "keep"),
}
"""Options that are one of several words."""


@dataclass(frozen=True, kw_only=True)
class WorldOptions(ModelOptions):
    """The options of `HybridTrackEnv`, which are keywords of `gym.make`: these and those of `ModelOptions`.

    Attributes:
        scheme: segments of an episode: "random" (6 segments of 50 to 100 ticks, all modes equally likely),
            "random 4x20-60", "L50r3 R75r5 S50", a key of `SCHEMES`, or a scheme object.
        bank: "published" treats the anchor as exact; "anchor_aware" includes the uncertainty of the anchor in
            the state of every turn, see `core.anchor_aware_bank`; "oracle" is the published bank anchored at
            the true state, an upper bound for evaluation that is not available in practice.
        reset_covariance: True starts every segment with P := I, as published; False carries over the
            covariance of the estimate. None means True for the published bank that follows the declared
            filter, and False otherwise.
        follow: what runs on to the end of a segment after a decision. "declared", as published: the filter of
            the declared hypothesis, whose estimate is the next anchor. "bank": all filters; the estimate and
            the next anchor are the mean of the posterior over all hypotheses, with its covariance
            (`core.merging`), so that a wrong decision costs its reward and nothing else.
        delay_cost: cost of a step, in units of the reward of a correct decision.
        correctness: "exact" requires the hypothesis, "type" only straight, left or right.
        actions: "all" waits or declares one of M hypotheses; "best" waits or declares the most likely one.
        undecided: decision on a segment that ends undecided: "likeliest" for the most likely hypothesis,
            "keep" for the last decided mode, as in the papers.

    Raises:
        ArgumentError: an option has a value that is not allowed.
    """

    switches: ClassVar[Literal["announced", "unknown"]] = "announced"
    """Whether the moments of the switches are announced."""

    scheme: str | Scheme = "random"
    bank: str = "published"
    reset_covariance: bool | None = None
    follow: Literal["declared", "bank"] = "declared"
    delay_cost: float = 0.02
    correctness: Literal["exact", "type"] = "exact"
    actions: Literal["all", "best"] = "all"
    undecided: Literal["likeliest", "keep"] = "likeliest"

    def __post_init__(self) -> None:
        fix = functools.partial(object.__setattr__, self)
        fix("scheme", parse_scheme(self.scheme))
        super().__post_init__()
        fix("delay_cost", check_within("delay_cost", self.delay_cost))
        for name, choices in CHOICES.items():
            fix(name, str(check_choice(name, getattr(self, name), choices)))
        if self.reset_covariance is not None:
            fix("reset_covariance", check_flag("reset_covariance", self.reset_covariance))
        if self.reset_covariance and self.bank == "oracle":
            raise reject("reset_covariance", True, "False or None with bank='oracle', whose anchor is exact")
        if self.robust and self.bank == "anchor_aware":
            raise reject("likelihood", str(self.likelihood), "'gaussian' with bank='anchor_aware'")
        self._check_radii_of_scheme()

    def _check_radii_of_scheme(self) -> None:
        """Check the radii of bank and scheme, and the ratios of all options."""
        assert isinstance(self.initial_error, tuple)
        signed_radii = self.table[:, SEGMENT_COLUMNS.index("signed_radius")]
        of_scheme = {abs(float(radius)) for radius in signed_radii if radius}
        missing = sorted(of_scheme - set(self.radii))
        if self.correctness == "exact" and missing:
            shown = ", ".join(map(str, missing[:3])) + (", ..." if len(missing) > 3 else "")
            allowed = f"radii that include {shown} of the scheme, or correctness='type'"
            raise reject("radii", self.radii, allowed)
        check_ratios(
            sorted(of_scheme | set(self.radii)), self.speed, self.tau, self.process_variance,
            self.variances.tolist(), self.initial_error[1],
        )  # fmt: skip

    @property
    def action_count(self) -> int:
        """Number of actions."""
        return 2 if self.actions == "best" else self.hypotheses + 1

    @property
    def axes(self) -> int:
        """Number of covariances per radius in the published bank: 1 if those of both axes are equal."""
        return 2 if self.follow == "bank" else self.variances.size

    @property
    def table(self) -> NDArray[np.float64]:
        """Segments in order, or the modes to draw from, see `scheme.segment_table`."""
        assert not isinstance(self.scheme, str)
        return segment_table(self.scheme, self.radii)

    @property
    def longest_segment(self) -> int:
        """Length of the longest possible segment [ticks]."""
        assert not isinstance(self.scheme, str)
        if isinstance(self.scheme, FixedScheme):
            return max(piece.length for piece in self.scheme.pieces)
        return self.scheme.lengths[1]

    @property
    def segments(self) -> int:
        """Number of segments of an episode."""
        assert not isinstance(self.scheme, str)
        return len(self.scheme.pieces) if isinstance(self.scheme, FixedScheme) else self.scheme.segments

    def parameters(self) -> NDArray[Any]:
        """Return (1,) record `PARAMETERS` for the kernel."""
        assert not isinstance(self.scheme, str)
        record = self.model_parameters(PARAMETERS)
        record["delay_cost"], record["segments"] = self.delay_cost, self.segments
        default = self.bank == "published" and self.follow == "declared"
        record["reset_covariance"] = default if self.reset_covariance is None else self.reset_covariance
        record["oracle"] = self.bank == "oracle"
        record["exact"] = self.correctness == "exact"
        record["action_count"] = self.action_count
        record["declare_best"] = self.actions == "best"
        record["keep_undecided"] = self.undecided == "keep"
        record["noise_whitener"] = np.exp(-0.5 * record["log_noise"])
        record["axes"] = self.axes
        if not isinstance(self.scheme, FixedScheme):
            record["random_scheme"] = True
            record["shortest"], record["longest"] = self.scheme.lengths
        return record
