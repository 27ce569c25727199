"""The fixed-lag smoother of the beam: exact against enumerated histories, and calibrated."""

import itertools

import numpy as np
import pytest

from baselines.rules.beam import BeamDecider, hazards
from baselines.rules.beam_filters import FIRST, LATER
from baselines.rules.beam_smoother import BeamSmoother, BranchTable, carry_past
from baselines.rules.rollout import record_statements
from hybrid_env import QuickestOptions

LAGS = (0, 3, 10)
T, M = 7, 3
ORDER = (1.0 - np.eye(M)) / (M - 1)


def switch_histories(table, modes, ticks):
    """Return (mode and first tick of the segment at every tick, prior probability) of all
    histories.
    """
    found = []
    for switches in itertools.product((False, True), repeat=ticks - 1):
        starts = [0, *(k + 1 for k, one in enumerate(switches) if one)]
        start_of = np.array([max(s for s in starts if s <= k) for k in range(ticks)])
        prior = 1.0 / modes / (modes - 1) ** (len(starts) - 1)
        for k, one in enumerate(switches):
            row = FIRST if start_of[k] == 0 else LATER
            age = k - start_of[k] + 1
            hazard = table[2 * row, age - 1]
            prior *= hazard if one else 1.0 - hazard
        for sequence in itertools.product(range(modes), repeat=len(starts)):
            if all(a != b for a, b in itertools.pairwise(sequence)):
                path = np.array([sequence[starts.index(s)] for s in start_of])
                found.append((path, start_of, prior))
    return found


@pytest.mark.parametrize("text", ["uniform 2-4", "1 + geometric 2"])
def test_the_carried_probabilities_are_those_of_all_histories(text):
    """Likelihoods are drawn for every mode and first tick of a segment, as if they came from
    filters.
    """
    table = hazards(QuickestOptions(durations=text, start="random", ticks=20).duration_laws)
    # Tick, first tick, mode.
    likelihood = np.random.default_rng(3).lognormal(
        0.0,
        1.5,
        (T, T, M),
    )
    past = np.zeros((1, T * M, T, M))
    before = None
    known = {}
    for tick in range(T):
        # Every pair of a mode and a first tick, with its probability by the forward recursion.
        pairs = [(start, mode) for start in range(tick + 1) for mode in range(M)]
        columns = {
            "modes": [mode for _, mode in pairs],
            "ages": [tick - start + 1 for start, _ in pairs],
            "rows": [FIRST if start == 0 else LATER for start, _ in pairs],
        }
        weights = []
        for start, mode in pairs:
            if tick == 0:
                weight = 1.0 / M
            else:
                ends = {
                    p: table[2 * (FIRST if p[0] == 0 else LATER), tick - 1 - p[0]] for p in known
                }
                if start < tick:
                    weight = known[start, mode] * (1.0 - ends[start, mode])
                else:
                    weight = sum(known[p] * ends[p] / (M - 1) for p in known if p[1] != mode)
            weights.append(weight * likelihood[tick, start, mode])
        known = dict(
            zip(
                pairs,
                np.array(weights) / np.sum(weights),
                strict=True,
            )
        )
        arrays = {name: np.zeros((1, T * M), np.int64) for name in columns}
        for name, column in columns.items():
            arrays[name][0, : len(pairs)] = column
        log_weights = np.full((1, T * M), -np.inf)
        with np.errstate(divide="ignore"):
            log_weights[0, : len(pairs)] = np.log(list(known.values()))
        now = BranchTable(**arrays, log_weights=log_weights, counts=np.array([len(pairs)]))
        carried = np.zeros_like(past)
        carry_past(
            now if before is None else before,
            now,
            past,
            carried,
            table,
            ORDER,
        )
        past = carried
        before = now

    expected = np.zeros((T, M))
    total = 0.0
    for path, starts, prior in switch_histories(table, M, T):
        weight = prior * np.prod([likelihood[k, starts[k], path[k]] for k in range(T)])
        expected[np.arange(T), path] += weight
        total += weight
    found = np.einsum("b,bkm->km", np.exp(log_weights[0]), past[0])[::-1]

    np.testing.assert_allclose(found, expected / total, atol=1e-12)
    filtered = [sum(known[p] for p in known if p[1] == mode) for mode in range(M)]
    np.testing.assert_allclose(found[-1], filtered, atol=1e-12)


@pytest.fixture(scope="module")
def smoothed():
    options = {
        "durations": "10 + geometric 15",
        "ticks": 80,
        "start": "random",
    }
    smoother = BeamSmoother(BeamDecider(QuickestOptions(**options), 0.0), LAGS)
    statements = record_statements(smoother, 150, 3, **options)
    beam = record_statements(BeamDecider(QuickestOptions(**options), 0.0), 150, 3, **options)
    return statements, beam, {lag: smoother.posterior(lag) for lag in LAGS}


def test_without_a_lag_it_is_the_posterior_of_the_beam(smoothed):
    statements, beam, posteriors = smoothed
    np.testing.assert_array_equal(statements.stated_modes, beam.stated_modes)
    for posterior in posteriors.values():
        assert posterior.shape == (80, 150, 3)
        np.testing.assert_allclose(posterior.sum(-1), 1.0, atol=1e-9)
        np.testing.assert_allclose(
            posterior[-1],
            posteriors[0][-1],
            atol=1e-12,
        )
    np.testing.assert_array_equal(posteriors[0].argmax(-1), beam.stated_modes)


@pytest.mark.parametrize("lag", LAGS)
def test_the_posterior_is_calibrated(smoothed, lag):
    """The mean of the largest posterior is the share of right ticks, up to the error of 150
    tracks.
    """
    statements, _, posteriors = smoothed
    best = posteriors[lag].argmax(-1)
    error = (posteriors[lag].max(-1) - (best == statements.true_modes)).mean(0)
    # The merging and the linearized filters cost some calibration: 0.02 is allowed for them.
    assert abs(error.mean()) < 0.02 + 4 * error.std() / np.sqrt(len(error))
