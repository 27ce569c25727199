"""MSPRT and gap rule against independently computed posteriors and against the error bound of
the MSPRT.
"""

import functools
import math

import numpy as np
from scipy.special import softmax

from baselines import GapDecider, MSPRTDecider
from baselines.rules import rollout
from hybrid_env import HybridTrackVectorEnv

record_decisions = functools.partial(
    rollout.record_decisions, env_id="hybrid_env:HybridTrackPublished-v0"
)


def test_rules_decide_as_posteriors_from_log_likelihoods():
    env = HybridTrackVectorEnv(64, tick_info=True, radii=(3.0, 5.0, 9.0), correctness="type")
    rows, info = env.reset(seed=3)
    kind = np.array([0, 1, 1, 1, 2, 2, 2])
    declared = np.zeros(3)
    for _ in range(200):
        posterior = softmax(info["log_likelihood"], axis=-1)
        ranked = np.sort(info["log_likelihood"], axis=-1)
        types = np.stack([posterior[:, kind == k].sum(-1) for k in range(3)], axis=-1)
        of_type = np.where(kind == types.argmax(-1)[:, None], posterior, -1.0)
        cases = (
            (MSPRTDecider(0.05), 1.0 - posterior.max(-1) <= 0.05, posterior),
            (GapDecider(3.0), ranked[:, -1] - ranked[:, -2] >= 3.0, posterior),
            (MSPRTDecider(0.05, by="type"), 1.0 - types.max(-1) <= 0.05, of_type),
        )
        for k, (decider, decides, values) in enumerate(cases):
            actions, _ = decider.predict(rows)
            # Rows are float32, so that a value exactly at the threshold could differ; none does.
            np.testing.assert_array_equal(actions, np.where(decides, values.argmax(-1) + 1, 0))
            declared[k] += np.count_nonzero(actions)
        rows, _, _, _, info = env.step(np.zeros(64, np.int64))

    assert (declared > 100).all()


def test_error_rate_is_close_to_alpha_if_the_posterior_is_exact():
    alpha = 0.05
    # The oracle bank has the exact posterior, so the error rate is at most alpha (Baum & Veeravalli
    # 1994).
    decisions = record_decisions(MSPRTDecider(alpha), episodes=1500, bank="oracle")
    decided = ~decisions.forced
    errors = int((~decisions.correct[decided]).sum())
    count = int(decided.sum())

    assert errors / count < alpha + 4 * math.sqrt(alpha * (1 - alpha) / count)
    # The overshoot of one tick is small.
    assert errors / count > 0.3 * alpha
