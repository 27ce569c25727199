"""Rules that restart filters agree with literal loops over filters in matrix form."""

import math

import numpy as np
import pytest
from own_modes import filter_of_mode
from recorded_rollouts import recorded

from baselines.rules.glr import RestartDecider
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions, Radar, Sensor
from hybrid_env.live import SQUARE

SHORT = {
    "ticks": 45,
    "durations": "uniform 8-15",
    "measurement_variance": (0.001, 0.002),
    "radii": (2.0, 4.0),
}


ROBUST = SHORT | {"likelihood": "student_t 4"}
MODES = SHORT | {"modes": "straight, stop, left 2, accelerate 2", "radii": ()}
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


def step(kalman, row, options):
    """Advance a matrix filter by the measurements of a row, if there are any."""
    if options.sensors:
        xx, xy, yy = options.variances[0] * row[-7:-4]
        rate = row[-4]
        radar = options.sensors[0]
        kalman.R = np.array([[xx, xy], [xy, yy]])
        kalman.rates = [] if np.isnan(rate) else [(rate, radar.position, radar.rate_deviation)]
    kalman.step(None if np.isnan(row[0]) else row[:2])


def literal(seen, options, mean, threshold, margin, window):
    """Statements (T,) and log ratios (T, M) of one track, (T, width), by definition."""
    M = options.hypotheses
    stated = int(seen[0, 16 : 16 + M].argmax())
    nominal = filter_of_mode(options, stated, seen[0, 2:6], seen[0, 6:16][SQUARE], exact=mean)
    others = [mode for mode in range(M) if mode != stated]
    # (filters by mode, log-likelihood of the stated mode before the start)
    tests = []
    statements = [stated]
    log_ratios = [np.zeros(M)]
    for row in seen[1:]:
        now = nominal.x[:4], nominal.P[:4, :4]
        new = {mode: filter_of_mode(options, mode, *now, exact=mean) for mode in others}
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


@pytest.mark.parametrize(
    ("given", "window", "margin", "mean"),
    [
        (SHORT, 6, 1.5, True),
        (SENSED, 100, 0.5, False),
        (MODES, 20, 0.5, True),
        (ROBUST, 6, 1.5, False),
    ],
    ids=["one sensor", "sensors", "modes", "Student's t"],
)
def test_statements_and_ratios_equal_those_of_a_literal_loop(given, window, margin, mean):
    options = QuickestOptions(**given)
    decider = RestartDecider(options, 2.5, margin, window, mean)
    env = HybridTrackQuickestVectorEnv(4, **given)
    seen, stated, states = recorded(env, decider, options.ticks)
    log_ratios = np.array([state.log_ratios for state in states])
    changes = 0
    for track in range(4):
        expected, values = literal(seen[:, track], options, mean, 2.5, margin, window)
        np.testing.assert_array_equal(stated[:, track], expected)
        np.testing.assert_allclose(log_ratios[:, track], values, rtol=1e-4, atol=1e-4)
        changes += (np.diff(expected) != 0).sum()

    assert changes > 8
