"""Rules that filter the measurements, in any units; restarted filters agree with literal loops."""

import math

import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter, MatrixKalmanFilter
from random_worlds import unit_scales

from baselines.rules.beam import BeamDecider
from baselines.rules.restarted import GLRDecider, MeanRatioDecider
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions, Radar, Sensor

TRIANGLE = np.triu_indices(4)
RESTARTED = (GLRDecider, MeanRatioDecider)
RULES = (*RESTARTED, BeamDecider)
SHORT = {
    "ticks": 45,
    "durations": "uniform 8-15",
    "measurement_variance": (0.001, 0.002),
    "radii": (2.0, 4.0),
}


SENSED = SHORT | {
    "measurement_variance": 0.001,
    "missed": 0.2,
    "sensors": (
        Radar(
            range_deviation=0.03,
            bearing_deviation=0.001,
            rate_deviation=0.1,
            position=(-30.0, 10.0),
        ),
        Sensor(variance=0.002, period=3),
    ),
}


def run(decider, tracks=4, seed=3, **options):
    """Return observations (T, N, width), statements (T, N) and evidence (T, N, M) of a decider."""
    env = HybridTrackQuickestVectorEnv(tracks, **options)
    env.reset(seed=seed)
    seen = []
    for _ in range(env.options.ticks):
        seen.append(decider.observe(env.world))
        env.step(np.zeros(tracks, np.int64))
    return np.array(seen), *replay(decider, seen)


def replay(decider, seen):
    """Return statements (T, N) and log ratios or log probabilities (T, N, M) for observations."""
    state = None
    stated = []
    evidence = []
    name = "log_probability" if isinstance(decider, BeamDecider) else "log_ratios"
    for observation in seen:
        actions, state = decider.predict(observation, state)
        stated.append(actions)
        evidence.append(getattr(state, name).copy())
    return np.array(stated), np.array(evidence)


def matrix_filter(bank, mode, state, P, options):
    R = np.broadcast_to(options.variances, 2)
    n = len(options.radii)
    radius = 0.0 if mode == 0 else options.radii[(mode - 1) % n]
    if bank == "published":
        side = "S" if mode == 0 else "L" if mode <= n else "R"
        return MatrixKalmanFilter(
            state,
            P,
            side,
            radius,
            options.tau,
            options.process_variance,
            np.diag(R),
        )
    sign = -1.0 if mode > n else 1.0
    return MatrixExtendedKalmanFilter(
        state,
        P,
        sign * radius,
        options.tau,
        options.process_variance,
        R,
    )


def step(kalman, row, options):
    """Advance a matrix filter by the measurements of a row, if there are any."""
    if options.sensors:
        xx, xy, yy = options.variances[0] * row[-7:-4]
        rate = row[-4]
        radar = options.sensors[0]
        kalman.R = np.array([[xx, xy], [xy, yy]])
        kalman.rates = [] if np.isnan(rate) else [(rate, radar.position, radar.rate_deviation)]
    kalman.step(None if np.isnan(row[0]) else row[:2])


def estimate(kalman):
    return (kalman.x, kalman.P) if hasattr(kalman, "x") else (kalman.s[:4], kalman.P[:4, :4])


def literal(seen, options, mean, threshold, margin, window, bank):
    """Statements (T,) and log ratios (T, M) of one track, (T, width), by definition."""
    M = options.hypotheses
    stated = int(seen[0, 16 : 16 + M].argmax())
    P = np.zeros((4, 4))
    P[TRIANGLE] = seen[0, 6:16]
    P += np.triu(P, 1).T
    nominal = matrix_filter(bank, stated, seen[0, 2:6], P, options)
    others = [mode for mode in range(M) if mode != stated]
    # (filters by mode, log-likelihood of the stated mode before the start)
    tests = []
    statements = [stated]
    log_ratios = [np.zeros(M)]
    for row in seen[1:]:
        new = {
            mode: matrix_filter(
                bank,
                mode,
                *estimate(nominal),
                options,
            )
            for mode in others
        }
        tests = [*tests, (new, nominal.log_likelihood)][-window:]
        step(nominal, row, options)
        logs = {mode: [] for mode in others}
        for filters, before in tests:
            for mode in others:
                step(filters[mode], row, options)
                logs[mode].append(filters[mode].log_likelihood - (nominal.log_likelihood - before))
        values = np.zeros(M)
        for mode in others:
            ratios = [math.exp(value) for value in logs[mode]]
            values[mode] = math.log(math.fsum(ratios) / len(ratios) if mean else max(ratios))
        log_ratios.append(values)
        best, second = sorted(others, key=lambda mode: -values[mode])[:2]
        # Otherwise rounding would matter.
        assert abs(values[best] - threshold) > 1e-4
        if values[best] >= threshold and values[best] - values[second] >= margin:
            nominal = tests[int(np.argmax(logs[best]))][0][best]
            nominal.log_likelihood = 0.0
            stated = best
            tests = []
            others = [mode for mode in range(M) if mode != stated]
        statements.append(stated)
    return statements, log_ratios


@pytest.mark.parametrize("rule", RESTARTED)
@pytest.mark.parametrize(
    "given",
    [SHORT, SENSED],
    ids=["one sensor", "sensors"],
)
@pytest.mark.parametrize(
    ("bank", "window", "margin"),
    [
        ("published", 6, 1.5),
        ("anchor_aware", 100, 0.5),
    ],
)
def test_statements_and_ratios_equal_those_of_a_literal_loop(rule, given, bank, window, margin):
    options = QuickestOptions(**given)
    decider = rule(options, 2.5, margin, window, bank)
    seen, stated, log_ratios = run(decider, **given)
    changes = 0
    for track in range(4):
        expected, values = literal(
            seen[:, track],
            options,
            decider.mean,
            2.5,
            margin,
            window,
            bank,
        )
        np.testing.assert_array_equal(stated[:, track], expected)
        np.testing.assert_allclose(
            log_ratios[:, track],
            values,
            rtol=1e-4,
            atol=1e-4,
        )
        changes += (np.diff(expected) != 0).sum()

    assert changes > 8


SCALED = {
    "radii": (5.0, 9.0),
    "speed": 2.0,
    "tau": 0.1,
    "process_variance": 0.001,
    "measurement_variance": 0.02,
    "initial_error": (0.3, 0.02),
}


@pytest.mark.parametrize(
    ("rule", "arguments"),
    [
        (GLRDecider, {"bank": "published"}),
        (MeanRatioDecider, {"bank": "anchor_aware"}),
        (BeamDecider, {}),
    ],
)
def test_units_change_no_statement(rule, arguments):
    results = []
    for units in ((1.0, 1.0), (1000.0, 60.0)):
        options = unit_scales(SCALED, *units) | {"ticks": 100}
        _, stated, log_ratios = run(
            rule(QuickestOptions(**options), **arguments),
            20,
            **options,
        )
        results.append((stated, log_ratios))
    for stated, log_ratios in results[1:]:
        np.testing.assert_array_equal(stated, results[0][0])
        np.testing.assert_allclose(
            log_ratios,
            results[0][1],
            rtol=1e-5,
            atol=1e-5,
        )


@pytest.mark.parametrize("rule", RULES)
def test_mirrored_tracks_have_mirrored_statements(rule):
    options = {"ticks": 200, "measurement_variance": (0.02, 0.03)}
    decider = rule(QuickestOptions(**options))
    seen, stated, _ = run(decider, 20, **options)
    signs = np.array([1, 1, -1, -1])
    mirrored = seen.copy()
    mirrored[..., 1] *= -1
    mirrored[..., 2:6] *= signs
    mirrored[..., 6:16] *= np.outer(signs, signs)[TRIANGLE]
    mirrored[..., 16:] = seen[..., [16, 18, 17]]
    again, _ = replay(decider, mirrored)

    np.testing.assert_array_equal(
        again,
        np.array([0, 2, 1])[stated],
    )
