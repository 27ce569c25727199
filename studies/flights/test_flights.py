"""Flights: data, labels, filters against closed forms, the semi-real form and the agent."""

import gzip
import itertools
import json

import numpy as np
import pytest
from scipy.stats import multivariate_t

from agents import run_command
from baselines import KalmanFilter, MotionModel, ThresholdDecider, run_filter
from studies.flights.__main__ import Flights
from studies.flights.agent import FlightAgent
from studies.flights.flight import TIERS, stack_flights
from studies.flights.labels import LEFT, RIGHT, STRAIGHT, label_flights, spans
from studies.flights.samples import flights_of, sample_flight
from studies.flights.scores import score_flights, value
from studies.flights.semi_real import semi_real_flight, state_semi_real
from studies.flights.simulated import FlightWorld, simulate_flight
from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import Batch, TurnModel, run_turn_imm, start_turns, step_turns, student_t


def reports(start=1_600_000_000.0):
    """A flight at 80 m/s near the equator with a left turn of 2 deg/s and a right one of 1.5
    deg/s.
    """
    rates = np.radians(np.repeat([0.0, 2.0, 0.0, -1.5, 0.0], [200, 45, 120, 60, 200]))
    heading = 0.3 + np.cumsum(rates)
    path = 80.0 * np.cumsum(np.exp(1j * heading))
    noise = np.random.default_rng(0).normal(0.0, 1.5, (2, len(path)))
    return [
        {
            "timestamp": int(1000 * (start + k)),
            "icao24": "abc123",
            "latitude": y / 111_320.0,
            "longitude": x / 111_320.0,
            "track": float(np.degrees(np.pi / 2.0 - angle) % 360.0),
        }
        for k, (x, y, angle) in enumerate(
            zip(path.real + noise[0], path.imag + noise[1], heading, strict=True)
        )
    ]


@pytest.fixture
def flight(tmp_path):
    """The second of two flights of an aircraft, with a repeated and an interpolated position."""
    rows = reports(1_600_002_000.0)
    for name in ("latitude", "longitude"):
        rows[50][name] = rows[49][name]
        rows[101][name] = 0.5 * (rows[100][name] + rows[102][name])
    with gzip.open(tmp_path / "known.json.gz", "wt") as file:
        json.dump(reports() + rows, file)
    flights_of.cache_clear()
    return sample_flight(tmp_path, "known:abc123:1")


def test_positions_are_cleaned_and_known_turns_are_labelled(flight):
    assert set(range(625)) - set(flight.times.tolist()) == {50.0, 101.0}
    (labels,) = label_flights([flight])
    firsts, _, modes = zip(*spans(labels.modes, [(0, len(labels.modes))]), strict=True)

    assert modes == (STRAIGHT, LEFT, STRAIGHT, RIGHT, STRAIGHT)
    np.testing.assert_allclose(labels.times[list(firsts)], [0, 200, 245, 365, 425], atol=5.0)
    assert np.degrees(labels.rates[215:230]).mean() == pytest.approx(2.0, rel=0.1)
    assert labels.scored.mean() > 0.93


def test_the_filter_with_one_model_is_a_kalman_filter(flight):
    # Isotropic noise and a Gaussian likelihood: the Kalman filter of constant velocity.
    batch = stack_flights([flight])._replace(timing=np.zeros(1))
    model = TurnModel(rates=(0.0,), acceleration=0.1, freedom=1e9)
    variance = float(batch.across[0]) ** 2
    kalman = KalmanFilter(MotionModel("CV", 2, 0.1), variance)
    first = batch.positions[0, 0], batch.positions[1, 0] - batch.positions[0, 0]
    spread = np.diag([variance, 1e4, variance, 1e4])
    start = (np.column_stack(first).reshape(1, 4), spread, 0.0)
    filtered = run_filter(kalman, batch.positions[1:], batch.times[1:], start=start)
    speeds = np.hypot(*np.moveaxis(filtered.velocities[:, 0], -1, 0))

    np.testing.assert_allclose(run_turn_imm(batch, model).speeds[1:, 0], speeds, rtol=1e-6)


def test_the_likelihood_is_that_of_a_student_t_distribution():
    innovation, spread = np.array([3.0, -1.0]), np.array([[4.0, 1.0], [1.0, 2.0]])
    expected = multivariate_t(shape=spread, df=5.0).logpdf(innovation)

    assert student_t(innovation, spread, 5.0)[1] == pytest.approx(expected)


def test_the_beam_has_all_histories_of_a_few_positions():
    # Every sequence of modes has a filter of its own; merging histories is the only difference.
    generator = np.random.default_rng(3)
    times = np.array([0.0, 1.0, 2.1, 3.0, 4.2])
    positions = np.column_stack([80.0 * times, 0.5 * times**2]) + generator.normal(0.0, 2.0, (5, 2))
    errors = np.array([2.0]), np.array([0.0])
    arrays = times[:, None], positions[:, None], np.zeros((5, 1)), *errors
    batch = Batch(((0, 0, 5),), ((0, 5),), (5,), *arrays)
    model = TurnModel(rates=(0.0, 2.0, -2.0), straight=10.0, turn=6.0)
    omega = np.radians(model.rates)
    leave = 1.0 / np.array([10.0, 6.0, 6.0])
    share = np.array([[0.0, 0.5, 0.5], [0.9, 0.0, 0.1], [0.9, 0.1, 0.0]])
    weights = np.zeros(3)
    for sequence in itertools.product(range(3), repeat=5):
        filters = start_turns(batch, 1, model)
        log_weight = np.log([0.9, 0.05, 0.05][sequence[0]])
        for row, (last, mode) in enumerate(itertools.pairwise(sequence), 1):
            step = batch.steps[row]
            ends = -np.expm1(-leave[last] * step.item())
            log_weight += np.log(1.0 - ends if mode == last else ends * share[last, mode])
            rates, weight = omega[[mode]], np.ones((1, 1))
            *filters, likelihood, _ = step_turns(batch, row, step, *filters, rates, weight, model)
            log_weight += likelihood.item()
        weights[sequence[-1]] += np.exp(log_weight)

    probabilities = run_turn_beam(batch, model, shortest=(0.0, 1e-9), branches=60)[-1, 0]
    np.testing.assert_allclose(probabilities, weights / weights.sum(), atol=0.01)


def test_deciders_of_the_environment_read_flights():
    # With hardly any noise or jitter, so that the truth is known.
    world = FlightWorld(jitter=1e-6, wander=1e-9, rates=(0.039, 0.041), speeds=(89.0, 91.0))
    tier = TIERS["B"]._replace(across=0.1, timing=1e-3)
    flight, labels = simulate_flight(tier, 1500.0, np.random.default_rng(2), world)
    made, copied = semi_real_flight(flight, labels, np.random.default_rng(1))
    stated = state_semi_real(ThresholdDecider(0.6), [made])

    assert made.tier.across == pytest.approx(142.0, rel=0.02)
    assert value(score_flights("threshold", [(made, copied)], stated)) > 0.8


def test_a_mirrored_flight_gives_mirrored_statements():
    generator = np.random.default_rng(5)
    batch = stack_flights([simulate_flight(TIERS["B"], 700.0, generator, FlightWorld())[0]])
    agent = FlightAgent.find("agent", ())()
    sides = batch, batch._replace(positions=batch.positions * [1.0, -1.0])
    stated, mirrored = (
        agent.statements(FlightTracks(side, run_turn_imm(side, TurnModel()))) for side in sides
    )

    # Ties of rounding errors.
    assert (np.array([0, 2, 1])[stated] == mirrored).mean() > 0.99


def test_the_quick_form_prints_tables_and_writes_pictures(tmp_path, capsys):
    names = ("imm", "imm:0.8", "cusum", "beam", "agent:8")
    line = ["--quick", "--out", str(tmp_path), "--deciders", *names]
    assert not run_command(Flights, "flights", line)
    result = json.loads((tmp_path / "flights.json").read_text())

    assert set(result["tiers"]) == {"A", "B", "C", "A-C"}
    figures = result["tiers"]["A-C"]
    assert set(figures) == set(names)
    assert min(of_decider["agreement"]["value"] for of_decider in figures.values()) > 0.8
    assert (tmp_path / "simulated-B-0.png").stat().st_size > 10_000
    assert "IMM threshold" in capsys.readouterr().out
