"""The beam equals a literal filter of pairs of mode and age, in matrices."""

import copy

import numpy as np
import pytest
from matrix_filters import FREEDOM, merged
from own_modes import filter_of_mode

from baselines.rules.beam import BeamDecider
from hybrid_env import QuickestOptions
from hybrid_env.durations import duration_probabilities, remaining_probabilities

TRIANGLE = np.triu_indices(4)


@pytest.mark.parametrize(
    ("text", "modes", "likelihood"),
    [
        ("uniform 4-7", None, "gaussian"),
        ("3 + geometric 2", None, f"student_t {FREEDOM}"),
        ("uniform 4-7", "straight, stop", "gaussian"),
        ("uniform 4-7", "straight, left 1.5, right 1.5, stop", f"student_t {FREEDOM}"),
    ],
)
def test_without_pruning_the_beam_is_the_filter_of_all_modes_and_ages(text, modes, likelihood):
    options = QuickestOptions(
        durations=text,
        measurement_variance=(0.01, 0.02),
        process_variance=0.01,
        ticks=40,
        radii=(1.5,),
        modes=modes,
        likelihood=likelihood,
        start="random",
    )
    M = options.hypotheses
    law = options.law
    first, later = (
        probabilities(law, 50)
        for probabilities in (remaining_probabilities, duration_probabilities)
    )
    generator = np.random.default_rng(5)
    root = 0.1 * generator.normal(0, 1, (4, 4))
    anchor = np.array([3.0, 1.5, -1.0, 1.2])
    P = root @ root.T
    position = anchor[[0, 2]] + 0.1 * np.arange(1, 14)[:, None] * anchor[[1, 3]]
    z = position + generator.normal(0, 0.15, (13, 2))

    # Mode, law of the duration, age, filter, weight.
    branches = [
        (mode, first, 1, filter_of_mode(options, mode, anchor, P), 1 / M) for mode in range(M)
    ]
    decider = BeamDecider(options, branches=200)
    start = [*anchor, *P[TRIANGLE], *np.log([1 / M] * M)]
    rows = np.hstack([z, np.tile(start, (13, 1))])
    _, state = decider.predict(rows[:1])
    for row in rows[1:]:
        ends = [p[age - 1] / p[age - 1 :].sum() for _, p, age, _, _ in branches]
        children = [
            (mode, p, age + 1, copy.deepcopy(kalman), weight * (1 - end))
            for (mode, p, age, kalman, weight), end in zip(branches, ends, strict=True)
            if end < 1 - 1e-9
        ]
        for new in range(M):
            shares = np.array(
                [
                    weight * end / (M - 1) * (mode != new)
                    for (mode, *_, weight), end in zip(branches, ends, strict=True)
                ]
            )
            if shares.sum() > 0:
                w = shares / shares.sum()
                parts = [(kalman.x[:4], kalman.P[:4, :4]) for *_, kalman, _ in branches]
                kalman = filter_of_mode(options, new, *merged(w, parts))
                children.append((new, later, 1, kalman, shares.sum()))
        branches = []
        for mode, p, age, kalman, weight in children:
            before = kalman.log_likelihood
            kalman.step(row[:2])
            weight *= np.exp(kalman.log_likelihood - before)
            branches.append((mode, p, age, kalman, weight))
        weights = np.zeros(M)
        for mode, *_, weight in branches:
            weights[mode] += weight
        _, state = decider.predict(row[None], state)
        probabilities = np.exp(state.log_probability[0])
        np.testing.assert_allclose(probabilities, weights / weights.sum(), rtol=2e-5, atol=1e-9)

    assert 10 < state.branches.counts[0] < 200
