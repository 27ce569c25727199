"""Sequential tests between all hypotheses. ATE tests only against the hypothesis that is currently
active. The MSPRT declares a hypothesis when its posterior is large enough (Baum & Veeravalli 1994,
"A sequential procedure for multihypothesis testing"), the gap rule when its likelihood ratio to
every other one is (Armitage 1950). If only the type of motion is rewarded, the posterior should be
that of the type, which neighbouring radii share.
"""

import math
from functools import partial
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Actions, Answer, Decider, Observations, Variants
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, checked
from hybrid_env.compiled import LOG_FLOOR
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel, ratio_limits

By = Literal["hypothesis", "type"]
ALPHAS = (
    0.6,
    0.5,
    0.4,
    0.3,
    0.25,
    0.2,
    0.15,
    0.12,
    0.1,
    0.08,
    0.06,
    0.05,
    0.04,
    0.03,
    0.02,
    0.015,
    0.01,
    5e-3,
    3e-3,
    1e-3,
    3e-4,
    1e-4,
    1e-5,
    1e-6,
    1e-8,
    1e-10,
)
"""Thresholds of the posterior error probability to sweep."""
PUBLISHED: dict[str, Any] = {"bank": "published", "evidence": 0.0, "follow": "declared"}
"""Options of the algorithms of the papers: their bank, on which every declaration counts."""
ROBUST = PUBLISHED | {"likelihood": "student_t 50"}
"""The same with the robust likelihood."""


def at_floor(log_ratio: FloatArray) -> BoolArray:
    """Return which log-likelihood ratios the environment has clipped, at `LOG_FLOOR`."""
    return log_ratio <= LOG_FLOOR + 1e-3


def rewarded(options: WorldOptions) -> By:
    """Return what the environment rewards: the right hypothesis, or its type."""
    return "type" if options.correctness == "type" else "hypothesis"


def types_of_radii(hypotheses: int) -> IntArray:
    """Return the type of each hypothesis of turn radii, (M,): 0 straight, 1 left, 2 right."""
    n = hypotheses // 2
    return np.repeat([0, 1, 2], [1, n, n])


def group_sums(values: AnyArray, groups: IntArray) -> FloatArray:
    """Return sums of (..., M) values over the hypotheses of each of G groups, (..., G). groups:
    (M,) place of the group of each hypothesis, such as its type.
    """
    parts = (values[..., groups == k] for k in range(groups.max() + 1))
    return np.stack([part.sum(-1, dtype=np.float64) for part in parts], axis=-1)


def error_and_best(
    posterior: NDArray[np.floating], groups: IntArray
) -> tuple[FloatArray, IntArray]:
    """Return the posterior error probability of the best declaration, and the hypothesis to
    declare, each (N,): the likeliest of the likeliest group, where only other groups are errors.
    """
    sums = group_sums(posterior, groups)
    chosen = sums.argmax(-1)[:, None]
    best = np.where(groups == chosen, posterior, -np.inf).argmax(-1)
    # Accurate where 1 - p would cancel.
    return np.where(np.arange(sums.shape[-1]) == chosen, 0.0, sums).sum(-1), best


class MSPRTDecider(Decider):
    """Declares the best hypothesis when its posterior error probability falls to alpha.

    Args:
        alpha: threshold of the error probability, above 1e-13 (the resolution of the observation),
            at most 1.
        by: "hypothesis" counts every other hypothesis as an error. "type" declares the most likely
            hypothesis of the most likely type and counts only other types as errors.
    """

    name = "msprt"
    title = "MSPRT"
    symbol = "alpha"
    thresholds = ALPHAS
    default = 0.02
    bounds = math.nextafter(math.exp(LOG_FLOOR), 1.0), 1.0
    variants: ClassVar[Variants] = {
        "msprt-type": {"title": "MSPRT of types", "by": "type"},
        "msprt-published": {"title": "MSPRT, published bank", "options": PUBLISHED},
        "msprt-aware": {
            "title": "MSPRT, anchor-aware",
            "options": {"bank": "anchor_aware"},
            "arguments": lambda options: {"by": rewarded(options)},
        },
        "msprt-oracle": {
            "title": "MSPRT, true anchor",
            "options": {"bank": "oracle"},
            "oracle": True,
            "arguments": lambda options: {"by": rewarded(options)},
        },
        "msprt-robust": {"title": "MSPRT, robust", "options": ROBUST},
    }

    # (M,) of the hypotheses, see `for_modes`; None are those of turn radii.
    types: IntArray | None = None

    def __init__(self, alpha: float = 0.02, by: By = "hypothesis"):
        super().__init__(alpha)
        self.by = checked("by", by, By)

    def for_modes(self, options: Any) -> Self:
        """See `Decider.for_modes`."""
        return self.changed(types=options.types)

    def types_in(self, layout: Layout) -> IntArray:
        """Return the types of the hypotheses of rows."""
        return types_of_radii(layout.hypotheses) if self.types is None else self.types

    def act(self, rows: Observations) -> Actions:
        """See `Decider.act`."""
        layout = Layout.of_rows(rows)
        log_ratio = layout.read(rows, "log_ratio")
        log_error, best = layout.read(rows, "log_error_probability"), log_ratio.argmax(-1)
        if self.by == "type":
            likelihood = np.where(at_floor(log_ratio), 0.0, np.exp(log_ratio))
            posterior = likelihood / likelihood.sum(-1, keepdims=True)
            error, best = error_and_best(posterior, self.types_in(layout))
            log_error = np.log(np.maximum(error, np.exp(LOG_FLOOR)))
        return np.where(log_error <= np.log(self.threshold), best + 1, 0)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return posterior_panel("Kalman filters", self.by == "type", self.threshold)

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the posterior of each hypothesis or of its type, (N, M)."""
        posterior = super().evidence(observation)
        types = self.types_in(Layout.of_rows(observation))
        return group_sums(posterior, types)[:, types] if self.by == "type" else posterior


def declare_types(decider: Decider, types: IntArray) -> Decider:
    """Return a decider for an environment with `actions="types"`: where it declares a hypothesis it
    declares its type. 0 waits, and type + 1 declares one. types: (M,) of the hypotheses.
    """
    types = np.concatenate([[0], types + 1])
    return decider.changed(predict=partial(_predict_types, decider, types))


def _predict_types(decider: Decider, types: IntArray, *arguments: Any, **named: Any) -> Answer:
    actions, state = decider.predict(*arguments, **named)
    return np.where(np.asarray(actions) < 0, actions, types[actions]), state


class GapDecider(Decider):
    """Declares the most likely hypothesis when its log-likelihood ratio to every other reaches a
    threshold.

    Args:
        threshold: ln A, above 0 and below 30, where the observation clips ratios.
    """

    name = "gap"
    title = "gap rule"
    symbol = "gap"
    default = 4.6
    thresholds = (
        0.2,
        0.5,
        1.0,
        1.5,
        2.0,
        2.5,
        3.0,
        3.5,
        4.0,
        4.6,
        5.0,
        5.5,
        6.0,
        7.0,
        8.0,
        10.0,
        13.0,
        17.0,
        22.0,
        28.0,
    )
    bounds = 1e-12, math.nextafter(-LOG_FLOOR, 0.0)

    def act(self, rows: Observations) -> Actions:
        """See `Decider.act`."""
        log_ratio = Layout.of_rows(rows).read(rows, "log_ratio")
        second = np.partition(log_ratio, -2, axis=-1)[:, -2]
        return np.where(second <= -self.threshold, log_ratio.argmax(-1) + 1, 0)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return EvidencePanel(
            label="log-likelihood ratio to the best other mode",
            limits=ratio_limits(self.threshold),
            thresholds={"": self.threshold},
            legend=f"gap {self.threshold:g}",
        )

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the log-likelihood ratio of each hypothesis to the most likely of all others,
        (N, M).
        """
        log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
        second, first = np.partition(log_ratio, -2, axis=-1)[:, -2:].T
        is_best = np.arange(log_ratio.shape[1]) == log_ratio.argmax(-1)[:, None]
        return log_ratio - np.where(is_best, second[:, None], first[:, None])
