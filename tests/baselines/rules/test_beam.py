"""The beam equals the posterior of all histories of switches."""

import copy

import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter

from baselines.rules.beam import BeamDecider
from baselines.rules.beam_prior import hazards
from hybrid_env import QuickestOptions
from hybrid_env.durations import duration_probabilities, parse_durations, remaining_probabilities

TRIANGLE = np.triu_indices(4)
# With a measurement after the first one.
TICKS = 12


def histories(law, modes, ticks):
    """Return (modes of all ticks, ticks at which a segment begins, probability) of every
    history.
    """
    longest = 4 * ticks
    first, later = (
        function(law, longest) for function in (remaining_probabilities, duration_probabilities)
    )
    written = []

    def extend(path, starts, probability, law_of_segment):
        left = ticks - len(path)
        for length in range(1, left + 1):
            if law_of_segment[length - 1] > 0:
                mode = path[-1]
                for other in set(range(modes)) - {mode}:
                    extend(
                        (*path, *[mode] * (length - 1), other),
                        (*starts, len(path) + length - 1),
                        probability * law_of_segment[length - 1] / (modes - 1),
                        later,
                    )
        lasts = probability * law_of_segment[max(left, 0) :].sum()
        if lasts > 0:
            written.append(((*path, *[path[-1]] * left), starts, lasts))

    for mode in range(modes):
        extend((mode,), (), 1.0 / modes, first)
    return written


def test_the_enumerated_histories_are_complete():
    law = parse_durations("uniform 2-4")
    all_histories = histories(law, 3, 6)

    assert len(set(all_histories)) == len(all_histories)
    assert sum(probability for _, _, probability in all_histories) == pytest.approx(1.0, rel=1e-12)
    # By the definition of the law: the first segment ends after tick 1 with probability 1 / mean.
    assert sum(p for _, starts, p in all_histories if 1 in starts) == pytest.approx(1 / 3)


@pytest.mark.parametrize("text", ["uniform 4-7", "3 + geometric 2"])
def test_without_pruning_the_beam_is_the_posterior_of_all_histories(text):
    options = QuickestOptions(
        durations=text,
        measurement_variance=(0.01, 0.02),
        process_variance=0.01,
        ticks=40,
        radii=(1.5,),
        start="random",
    )
    law, R = options.law, options.measurement_variance
    generator = np.random.default_rng(5)
    root = 0.1 * generator.normal(0, 1, (4, 4))
    anchor = np.array([3.0, 1.5, -1.0, 1.2])
    P = root @ root.T
    position = (
        np.cumsum(
            np.tile(0.1 * anchor[[1, 3]], (TICKS, 1)),
            axis=0,
        )
        + anchor[[0, 2]]
    )
    z = position + generator.normal(0, 0.15, (TICKS, 2))
    filters = {}

    def filter_after(path, starts):
        """Return the filter of a history after the measurements of its ticks, and the
        log-likelihood.
        """
        tick = len(path) - 1
        key = path, starts
        if key not in filters:
            if tick == 0:
                new = MatrixExtendedKalmanFilter(
                    anchor,
                    P,
                    signed(path[0]),
                    0.1,
                    0.01,
                    R,
                )
            else:
                new = copy.deepcopy(filter_after(path[:-1], tuple(k for k in starts if k < tick)))
                if tick in starts:
                    total = new.log_likelihood
                    new = MatrixExtendedKalmanFilter(
                        new.s[:4],
                        new.P[:4, :4],
                        signed(path[-1]),
                        0.1,
                        0.01,
                        R,
                    )
                    new.log_likelihood = total
                new.step(z[tick - 1])
            filters[key] = new
        return filters[key]

    def signed(mode):
        return (0.0, 1.5, -1.5)[mode]

    decider = BeamDecider(options, branches=20_000, merged=False)
    start = [*anchor, *P[TRIANGLE], *np.log([1 / 3] * 3)]
    rows = np.hstack([np.vstack([position[:1], z]), np.tile(start, (TICKS + 1, 1))])
    state = None
    for tick in range(TICKS + 1):
        _, state = decider.predict(rows[tick : tick + 1], state)
        if tick not in (0, 1, 5, 12):
            continue
        weights = np.zeros(3)
        for path, starts, probability in histories(law, 3, tick + 1):
            weights[path[-1]] += probability * np.exp(filter_after(path, starts).log_likelihood)
        np.testing.assert_allclose(
            np.exp(state.log_probability[0]),
            weights / weights.sum(),
            rtol=2e-5,
            atol=1e-9,
        )

    assert 50 < state.branches.counts[0] < 20_000


@pytest.mark.parametrize("text", ["25 + geometric 50", "uniform 5-9"])
def test_hazards_give_back_the_law(text):
    laws = QuickestOptions(
        durations=text,
        start="random",
        ticks=400,
    ).duration_laws
    table = hazards(laws)
    survival = np.cumprod(
        np.insert(1.0 - table, 0, 1.0, axis=1),
        axis=1,
    )[:, :-1]

    np.testing.assert_allclose(survival * table, laws, atol=1e-12)
