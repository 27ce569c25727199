import gzip
import json

import numpy as np
import pytest

from baselines import KalmanFilter, MotionModel, run_filter
from studies.flights.flight import stack_flights
from studies.flights.labels import LEFT, RIGHT, STRAIGHT, label_flights
from studies.flights.samples import Samples
from studies.flights.turns import TurnModel, run_turn_imm

# Degrees of latitude.
METRE = 1.0 / 111_320.0


def reports(icao="abc123", start=1_600_000_000.0, seed=0):
    """A flight at 80 m/s near the equator with a left turn of 2 deg/s and a right one of 1.5
    deg/s.
    """
    generator = np.random.default_rng(seed)
    rates = np.radians(
        np.repeat(
            [0.0, 2.0, 0.0, -1.5, 0.0],
            [200, 45, 120, 60, 200],
        )
    )
    heading = 0.3 + np.cumsum(rates)
    path = np.cumsum(
        80.0 * np.column_stack([np.cos(heading), np.sin(heading)]),
        axis=0,
    )
    path += generator.normal(0.0, 1.5, path.shape)
    return [
        {
            "timestamp": int(1000 * (start + k)),
            "icao24": icao,
            "latitude": y * METRE,
            "longitude": x * METRE,
            "track": float(np.degrees(np.pi / 2.0 - angle) % 360.0),
        }
        for k, ((x, y), angle) in enumerate(zip(path, heading, strict=True))
    ]


def write(folder, rows, name="known"):
    folder.mkdir(parents=True, exist_ok=True)
    with gzip.open(folder / f"{name}.json.gz", "wt") as file:
        json.dump(rows, file)
    return folder


@pytest.fixture
def flight(tmp_path):
    return Samples(write(tmp_path, reports())).flight("known:abc123:0")


def test_flights_are_divided_at_gaps_and_by_aircraft(tmp_path):
    rows = reports() + reports(start=1_600_002_000.0, seed=1) + reports(icao="39e415", seed=2)
    samples = Samples(write(tmp_path / "inner", rows).parent)

    assert set(samples.flights_of("known")) == {
        "known:abc123:0",
        "known:abc123:1",
        "known:39e415:0",
    }
    flight = samples.flight("known:abc123:1")
    assert (flight.tier.name, len(flight.times), flight.times[0]) == ("B", 625, 0.0)


def test_repeated_and_interpolated_positions_are_left_out(tmp_path):
    rows = reports()
    rows[50] |= {name: rows[49][name] for name in ("latitude", "longitude")}
    for name in ("latitude", "longitude"):
        rows[101][name] = 0.5 * (rows[100][name] + rows[102][name])
    flight = Samples(write(tmp_path, rows)).flight("known:abc123:0")

    assert set(range(625)) - set(flight.times.tolist()) == {50.0, 101.0}


def test_labels_of_known_turns(flight):
    (labels,) = label_flights([flight])
    pieces = [(mode, labels.times[first]) for first, _, mode in labels.pieces]

    assert [mode for mode, _ in pieces] == [STRAIGHT, LEFT, STRAIGHT, RIGHT, STRAIGHT]
    assert np.allclose([begin for _, begin in pieces], [0, 200, 245, 365, 425], atol=5.0)
    assert np.degrees(labels.rates[215:230]).mean() == pytest.approx(2.0, rel=0.1)
    assert labels.scored.mean() > 0.93


def test_the_filter_with_one_model_is_a_kalman_filter(flight):
    # Isotropic noise and a Gaussian likelihood: the Kalman filter of constant velocity.
    batch = stack_flights([flight])._replace(timing=np.zeros(1))
    model = TurnModel(rates=(0.0,), acceleration=0.1, freedom=1e9)
    estimates = run_turn_imm(batch, model)
    across = float(batch.across[0])
    kalman = KalmanFilter(MotionModel("CV", 2, 0.1), across**2)
    first = batch.positions[0, 0], batch.positions[1, 0] - batch.positions[0, 0]
    start = np.column_stack(first).reshape(1, 4)
    spread = np.diag([across**2, 1e4, across**2, 1e4])
    filtered = run_filter(
        kalman,
        batch.positions[1:],
        batch.times[1:],
        start=(start, spread, 0.0),
    )
    speeds = np.hypot(*np.moveaxis(filtered.velocities[:, 0], -1, 0))

    np.testing.assert_allclose(
        estimates.speeds[1:, 0],
        speeds,
        rtol=1e-6,
    )
