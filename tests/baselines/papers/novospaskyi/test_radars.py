"""Radars, their noise and their merged measurements; errors as the thesis computes them."""

import numpy as np
import pytest

from baselines.papers.novospaskyi import radars
from baselines.papers.novospaskyi.flights import point_mass_flights
from baselines.papers.novospaskyi.radars import draw_noise, flight_errors, measure, scan_flight
from baselines.papers.reproduction import paired_ratio


@pytest.fixture(scope="module")
def flights():
    return point_mass_flights(8, 3, 8)


@pytest.fixture(scope="module")
def scans(flights):
    return [scan_flight(flight, np.random.default_rng((3, k))) for k, flight in enumerate(flights)]


def test_radars_stand_near_the_flight_and_apart_from_each_other(flights, scans):
    for flight, scan in zip(flights, scans, strict=True):
        assert scan.radars.shape == (2, 3)
        assert np.linalg.norm(scan.radars[0] - scan.radars[1]) >= radars.SEPARATION
        for radar in scan.radars:
            ways = np.linalg.norm(flight.positions[:, :2] - radar[:2], axis=1)
            assert ways.min() <= radars.OFFSETS[1]
            assert radars.HEIGHTS[0] <= radar[2] <= radars.HEIGHTS[1]


def test_each_radar_measures_once_a_second_whatever_is_in_its_range(flights, scans):
    for flight, scan in zip(flights, scans, strict=True):
        assert (np.diff(scan.times) > 0.0).all()
        for index, radar in enumerate(scan.radars):
            times = scan.times[scan.radar == index]
            seconds = np.diff(times) / radars.PERIOD
            np.testing.assert_allclose(seconds, seconds.round(), atol=1e-9)
            # the same moments by the flight's own record: those in range are measured, no others
            all_times = np.arange(times[0] % radars.PERIOD, flight.times[-1], radars.PERIOD)
            expected = [
                time
                for time in all_times
                if np.linalg.norm(flight.states_at(np.array([time]))[0][0] - radar) <= radars.RANGE
            ]
            np.testing.assert_allclose(times, expected, atol=1e-9)
        positions, velocities = flight.states_at(scan.times)
        np.testing.assert_allclose(scan.positions, positions)
        np.testing.assert_allclose(scan.velocities, velocities)


def test_measurements_of_two_radars_never_follow_each_other_at_once(scans):
    steps = np.concatenate([np.diff(scan.times) for scan in scans])
    assert steps.min() > 0.49 * radars.PERIOD
    assert len(np.unique(steps.round(6))) >= 3  # half a period, a period, and gaps


def test_gaussian_noise_has_its_deviation_and_levy_noise_its_characteristic_function():
    count = 30_000
    gaussian = draw_noise("gaussian", count, np.random.default_rng(0))
    # 4 standard errors of a deviation, 1 / sqrt(2 n) each
    assert gaussian.std() == pytest.approx(radars.SIGMA, rel=4.0 / np.sqrt(6 * count))
    levy = draw_noise("levy", count, np.random.default_rng(1))
    assert np.abs(levy).max() == radars.CLIP
    for frequency in (0.02, 0.08):
        expected = np.exp(-((radars.SIGMA * frequency) ** radars.STABILITY))
        # 4 standard errors of a mean of cosines, at most sqrt(1/2) each, and 3e-4 of the draws are clipped
        bound = 4.0 * np.sqrt(0.5 / (3 * count)) + 2 * 3e-4
        assert np.cos(frequency * levy).mean() == pytest.approx(expected, abs=bound)


def test_noise_of_a_flight_does_not_depend_on_the_other_flights(scans):
    all_tracks, one = measure(scans, "levy", (0, 1)), measure(scans[:1], "levy", (0, 1))
    count = len(scans[0].times)
    np.testing.assert_array_equal(all_tracks.measurements[0, :count], one.measurements[0])
    assert np.isnan(all_tracks.measurements[0, count:]).all()
    assert (np.diff(all_tracks.times, axis=1) >= 0.0).all()


def test_errors_are_means_over_axes_of_the_errors_of_a_flight(scans):
    tracks = measure(scans, "gaussian", (5,))
    rmse, mae = flight_errors(tracks.measurements, tracks.positions)
    for k, scan in enumerate(scans):
        error = tracks.measurements[k, : len(scan.times)] - scan.positions
        axes = [np.sqrt(np.mean(error[:, axis] ** 2)) for axis in range(3)]
        assert rmse[k] == pytest.approx(np.mean(axes))
        assert mae[k] == pytest.approx(np.abs(error).mean())


def test_a_paired_ratio_has_no_spread_if_one_filter_is_a_multiple_of_the_other():
    errors = np.random.default_rng(0).uniform(5.0, 15.0, (4, 30))
    assert paired_ratio(0.7 * errors, errors, seed=0) == pytest.approx((0.7, 0.7, 0.7))
    ratio, low, high = paired_ratio(np.roll(errors, 1, axis=1), errors, seed=0)
    assert low < ratio < high
