"""The evidence of a decider for unknown switch moments: the probabilities that it compares."""

import copy
import functools
from typing import Any

import numpy as np
from scipy.special import softmax

from agents.playing.evidence import DeciderEvidence
from baselines import ThresholdDecider
from baselines.rules.beam import BeamDecider
from baselines.rules.measurements import MeasurementDecider
from hybrid_env.observation import QuickestLayout
from hybrid_env.rendering.evidence import probability_panel


def statement_evidence(decider: Any) -> DeciderEvidence:
    """Return the evidence of a classical or learned decider.

    It is the posterior of a beam or of a policy. Rules that compare other statistics have the probabilities
    of the bank beside their statements. `compute` takes what the decider observes.
    """
    match decider:
        case BeamDecider():
            panel = probability_panel("beam", decider.rule.threshold)
            return DeciderEvidence(panel, functools.partial(_beam_probabilities, decider))
        case MeasurementDecider():
            return DeciderEvidence(
                probability_panel("bank"), lambda rows, state, start: np.exp(rows[:, -decider.hypotheses :])
            )
        case ThresholdDecider():
            return DeciderEvidence(probability_panel("bank", decider.threshold), _bank_probabilities)
    # PyTorch is imported only here, because it loads slowly
    from agents.learned.policy import StatementPolicyDecider

    if isinstance(decider, StatementPolicyDecider):
        return DeciderEvidence(
            probability_panel("policy"),
            lambda rows, state, start: softmax(decider.logits(rows, state, start)[0], axis=-1),
        )
    return DeciderEvidence(probability_panel("bank"), _bank_probabilities)


def _beam_probabilities(decider: BeamDecider, observation: Any, state: Any, start: Any) -> Any:
    """Return the posterior of a beam, (N, M). Arguments as for its `predict`."""
    # a copy, because the decider changes its state in place
    return np.exp(decider.predict(observation, copy.deepcopy(state), start)[1].log_probability)


def _bank_probabilities(rows: Any, state: Any, start: Any) -> Any:
    """Return the probabilities of the modes of the bank, (N, M), from rows of the environment."""
    return np.exp(QuickestLayout.of_rows(rows).read(rows, "log_probability"))
