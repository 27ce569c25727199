"""With `follow="bank"` the anchor is the posterior mean over all filters, with the posterior covariance."""

import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv, KalmanBank

OPTIONS = {"radii": (3.0, 8.0), "measurement_variance": (0.5, 2.0)}


def posterior(log_likelihood):
    weights = np.exp(log_likelihood - log_likelihood.max())
    return weights / weights.sum()


def test_the_anchor_is_the_mixture_of_the_filters():
    """One segment is repeated with `KalmanBank`, from the measurements in the trace."""
    env = HybridTrackVectorEnv(3, follow="bank", trace_rows=200, **OPTIONS)
    env.reset(seed=1)
    anchors = env.world.field("anchor")
    kept = env.world.field("covariance")
    first = [env.world.read_trace(i)[0, 4:6] for i in range(3)]
    env.step(np.array([1, 2, 4]))
    for i in range(3):
        trace = env.world.read_trace(i)[:-1]  # the last row is the first tick of the next segment
        bank = KalmanBank(radii=(3.0, 8.0), measurement_variance=(0.5, 2.0))
        bank.anchor(anchors[i], (kept[i, 0], kept[i, 1], kept[i, 4]))
        bank._bank.covariances["xx"][1] = kept[i, 7]
        bank._bank.covariances["vv"][1] = kept[i, 9]
        for measurement in (first[i], *trace[:, 4:6]):
            log_likelihood = bank.step(measurement)
            weights = posterior(log_likelihood)
            mean = weights @ bank.estimates
        np.testing.assert_allclose(env.world.field("anchor")[i], mean, rtol=1e-9)
        np.testing.assert_allclose(trace[-1, 6:8], mean[[0, 2]], rtol=1e-9)
        expected = np.zeros((4, 4))
        for h in range(5):
            deviation = bank.estimates[h] - mean
            own = np.zeros((4, 4))
            for axis in range(2):
                xx, xv, vv = bank.covariances[h, axis]
                own[2 * axis : 2 * axis + 2, 2 * axis : 2 * axis + 2] = [[xx, xv], [xv, vv]]
            expected += weights[h] * (own + np.outer(deviation, deviation))
        found = env.world.field("covariance")[i]
        np.testing.assert_allclose(found, expected[np.triu_indices(4)], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_a_declaration_does_not_change_the_stream(bank):
    """Wrong and right declarations at different ticks give the same next segment."""
    rows = []
    for action, ticks in ((1, 0), (2, 3), (3, 20)):
        env = HybridTrackEnv(follow="bank", bank=bank)
        env.reset(seed=4)
        for _ in range(ticks):
            env.step(0)
        row, _, _, _, info = env.step(action)
        rows.append(np.delete(row, [12, 13, 14]))  # without the previous mode
        assert info["segment"] == 1
    np.testing.assert_array_equal(rows[0], rows[1])
    np.testing.assert_array_equal(rows[0], rows[2])
