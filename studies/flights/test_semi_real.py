from dataclasses import replace

import numpy as np
import pytest

from baselines import KalmanFilter, MotionModel, ThresholdDecider, run_filter, smooth
from studies.flights.flight import TIERS
from studies.flights.metrics import STATISTICS, score_flights
from studies.flights.semi_real import semi_real_flights, smooth_path, state_semi_real
from studies.flights.simulated import FlightWorld, simulate_flights
from studies.flights.turns import STRAIGHT


def test_between_positions_the_path_is_that_of_the_smoother():
    # The smoother itself, with times without a measurement.
    generator = np.random.default_rng(0)
    times = np.cumsum(generator.uniform(1.0, 6.0, 40))
    heading = np.cumsum(generator.normal(0.0, 0.2, 40))
    positions = np.cumsum(
        300.0 * np.column_stack([np.cos(heading), np.sin(heading)]),
        axis=0,
    )
    middle = np.setdiff1d(
        np.linspace(times[0], times[-1], 77),
        times,
    )
    moments = np.sort(np.concatenate([times, middle]))
    values = np.full((len(moments), 2), np.nan)
    measured = np.isin(moments, times)
    values[measured] = positions

    def states(z, t):
        model = MotionModel("CA", 2, 1.0)
        return smooth(
            model,
            run_filter(KalmanFilter(model, 25.0, (200.0, 5.0)), z, t),
            t,
        ).states

    path = smooth_path(times, states(positions, times), middle)

    np.testing.assert_allclose(
        path,
        states(values, moments)[~measured][:, [0, 1, 3, 4]],
        rtol=1e-4,
        atol=0.05,
    )


@pytest.fixture(scope="module")
def simulated():
    # With hardly any noise or jitter, so that the truth is known.
    world = FlightWorld(
        jitter=1e-6,
        wander=1e-9,
        rates=(0.039, 0.041),
        speeds=(89.0, 91.0),
    )
    tier = TIERS["B"]._replace(across=0.1, timing=1e-3)
    return simulate_flights(tier, 3, 2500.0, np.random.default_rng(2), world)


def test_noise_and_ticks(simulated):
    flights, labels = simulated
    made, copied = semi_real_flights(flights, labels, np.random.default_rng(1))
    for flight, one, label, copy in zip(flights, made, labels, copied, strict=True):
        np.testing.assert_array_equal(
            np.diff(one.times),
            1.0,
        )
        assert one.pieces == [(0, len(one.times))]
        assert one.tier[1:3] == (pytest.approx(142.0, rel=0.02), 0.0)
        true = np.column_stack(
            [np.interp(one.times, flight.times, axis) for axis in flight.positions.T]
        )
        errors = (one.positions - true) / one.tier.across
        count = errors.size
        # Mean and mean square of standard normal errors, 4.5 standard deviations.
        assert abs(errors.mean()) < 4.5 / np.sqrt(count)
        assert abs((errors**2).mean() - 1.0) < 4.5 * np.sqrt(2.0 / count)
        row = np.abs(one.times[:, None] - flight.times).argmin(1)
        apart = np.abs(one.times - flight.times[row])
        # Two positions are not equally near.
        clear = np.abs(apart - 0.5) > 1e-6
        np.testing.assert_array_equal(
            copy.modes[clear],
            label.modes[row][clear],
        )


def test_deciders_of_the_environment_read_flights_in_any_unit(simulated):
    made, copied = semi_real_flights(*simulated, np.random.default_rng(1))
    stated = state_semi_real(ThresholdDecider(0.6), made)
    scores = score_flights("threshold", made, copied, stated)

    assert scores.estimate(STATISTICS["agreement"]).value > 0.85
    assert any((one != STRAIGHT).any() for one in stated)
    scaled = [
        replace(
            one,
            tier=one.tier._replace(across=1000.0 * one.tier.across),
            positions=1000.0 * one.positions,
        )
        for one in made
    ]
    for one, other in zip(
        stated,
        state_semi_real(ThresholdDecider(0.6), scaled),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)
