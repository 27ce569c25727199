"""Flights: data, labels, filters against closed forms, and the agent."""

import itertools
import json

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_t

from agents import run_command
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter
from studies.flights.__main__ import Flights
from studies.flights.flight import TIERS, Flight, stack_flights
from studies.flights.hindsight import HINDSIGHT, HindsightRule, turn_options
from studies.flights.labels import LEFT, RIGHT, STRAIGHT, label_flights, spans
from studies.flights.samples import sample_flight
from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import TurnModel, run_turn_imm, start_turns, step_turns, student_t


@pytest.fixture
def flight(tmp_path):
    """The second of two flights of an aircraft at 80 m/s, with a left turn of 2 deg/s, a right one
    of 1.5 deg/s, a repeated and an interpolated position.
    """
    rates = np.radians(np.repeat([0.0, 2.0, 0.0, -1.5, 0.0], [200, 45, 120, 60, 200]))
    heading = 0.3 + np.cumsum(rates)
    path = 80.0 * np.cumsum(np.exp(1j * heading))
    noise = np.random.default_rng(0).normal(0.0, 1.5, (2, len(path)))
    begin = 1000 * (1_600_000_000 + np.arange(len(path)))
    # Near the equator.
    reports = pd.DataFrame(
        {
            "timestamp": begin,
            "icao24": "abc123",
            "latitude": (path.imag + noise[1]) / 111_320.0,
            "longitude": (path.real + noise[0]) / 111_320.0,
            "track": np.degrees(np.pi / 2.0 - heading) % 360.0,
        }
    )
    second = reports.assign(timestamp=begin + 2_000_000)
    axes = ["latitude", "longitude"]
    second.loc[50, axes] = second.loc[49, axes]
    second.loc[101, axes] = 0.5 * (second.loc[100, axes] + second.loc[102, axes])
    pd.concat([reports, second]).to_json(tmp_path / "known.json.gz", orient="records")
    return sample_flight(tmp_path, "known:abc123:1")


def test_positions_are_cleaned_and_known_turns_are_labelled(flight):
    assert set(range(625)) - set(flight.times.tolist()) == {50.0, 101.0}
    (labels,) = label_flights([flight])
    rows, modes = zip(*spans(labels.modes, [slice(0, len(labels.modes))]), strict=True)

    assert modes == (STRAIGHT, LEFT, STRAIGHT, RIGHT, STRAIGHT)
    firsts = labels.times[[part.start for part in rows]]
    np.testing.assert_allclose(firsts, [0, 200, 245, 365, 425], atol=5.0)
    assert np.degrees(labels.rates[215:230]).mean() == pytest.approx(2.0, rel=0.1)
    assert labels.scored.mean() > 0.93


def test_the_filter_with_one_model_is_a_kalman_filter(flight):
    # Isotropic noise and a Gaussian likelihood: the Kalman filter of constant velocity.
    batch = stack_flights([flight])._replace(timing=np.zeros(1))
    model = TurnModel(rates=(0.0,), acceleration=0.1, freedom=1e9)
    variance = float(batch.across[0]) ** 2
    first = batch.positions[0, 0], batch.positions[1, 0] - batch.positions[0, 0]
    spread = np.diag([variance, 1e4, variance, 1e4])
    kalman = KalmanFilter(MotionModel("CV", 2, 0.1), variance)
    kalman.begin_from(np.column_stack(first).reshape(1, 4), spread)
    filtered = run_filter(kalman, batch.positions[1:], batch.times[1:], begun=0.0)
    speeds = np.hypot(*np.moveaxis(filtered.velocities[:, 0], -1, 0))

    np.testing.assert_allclose(run_turn_imm(batch, model).speeds[1:, 0], speeds, rtol=1e-6)


def test_the_likelihood_is_that_of_a_student_t_distribution():
    innovation, spread = np.array([3.0, -1.0]), np.array([[4.0, 1.0], [1.0, 2.0]])
    expected = multivariate_t(shape=spread, df=5.0).logpdf(innovation)

    assert student_t(innovation, spread, 5.0)[1] == pytest.approx(expected)


def test_the_beam_has_all_histories_of_a_few_positions():
    # Every sequence of modes has a filter of its own; merging histories is the only difference.
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.uniform(0.9, 1.2, 22))
    positions = np.column_stack([80.0 * times, 0.5 * times**2]) + generator.normal(
        0.0, 2.0, (22, 2)
    )
    batch = stack_flights(
        [Flight("", TIERS["B"]._replace(across=2.0, timing=0.0), times, positions)]
    )
    model = TurnModel(rates=(0.0, 2.0, -2.0), straight=10.0, turn=6.0)
    leave = 1.0 / np.array([10.0, 6.0, 6.0])
    share = np.array([[0.0, 0.5, 0.5], [0.9, 0.0, 0.1], [0.9, 0.1, 0.0]])
    weights = np.zeros(3)
    for sequence in itertools.product(range(3), repeat=5):
        filters = start_turns(batch, 1, model)
        log_weight = np.log([0.9, 0.05, 0.05][sequence[0]])
        for row, (last, mode) in enumerate(itertools.pairwise(sequence), 1):
            ends = -np.expm1(-leave[last] * batch.steps[row].item())
            log_weight += np.log(1.0 - ends if mode == last else ends * share[last, mode])
            rates = np.radians(model.rates)[[mode]]
            *filters, likelihood, _ = step_turns(
                batch, row, batch.steps[row], *filters, rates, np.ones((1, 1)), model
            )
            log_weight += likelihood.item()
        weights[sequence[-1]] += np.exp(log_weight)

    probabilities = run_turn_beam(batch, model, shortest=(0.0, 1e-9), branches=60)[4, 0]
    np.testing.assert_allclose(probabilities, weights / weights.sum(), atol=0.01)


@pytest.mark.parametrize("radii", [True, False])
def test_hindsight_finds_when_known_turns_begin_and_end(flight, radii):
    (model,) = HINDSIGHT.models
    batch = stack_flights([flight])
    stated = HindsightRule(radii=radii).statements(batch, None, [(1.0,), (0.5,), (1.0,)], model)
    rows, modes = zip(*spans(stated[:, 0, 0], flight.pieces), strict=True)

    assert modes == (STRAIGHT, LEFT, STRAIGHT, RIGHT, STRAIGHT)
    firsts = flight.times[[part.start for part in rows]]
    np.testing.assert_allclose(firsts, [0, 200, 245, 365, 425], atol=3.0)
    np.testing.assert_array_equal(stated[..., 0], stated[..., 2])


@pytest.mark.parametrize("radii", [True, False])
def test_hindsight_has_the_modes_and_changes_of_the_filter(radii):
    model = TurnModel(rates=(0.0, 2.0, -2.0, 3.0))
    options = turn_options(model, 80.0, radii)

    changes = np.eye(4) + model.generator
    np.testing.assert_allclose(options.transition_matrix, changes, atol=1e-6)
    if radii:
        signed = 80.0 / np.radians(model.rates[1:])
        np.testing.assert_allclose(options.motions["signed_radius"][1:], signed)


def test_the_quick_form_prints_tables_and_writes_pictures(tmp_path, capsys):
    names = ("imm", "imm:0.8", "cusum", "beam", "hindsight", "agent:8")
    line = ["--quick", "--out", str(tmp_path), "--deciders", *names]
    assert not run_command(Flights, "flights", line)
    tiers = json.loads((tmp_path / "flights.json").read_text())["tiers"]

    assert set(tiers) == {"A", "B", "C", "A-C"}
    agreements = {name: numbers["agreement"]["value"] for name, numbers in tiers["A-C"].items()}
    assert set(names) < set(agreements)
    assert min(agreements.values()) > 0.8
    assert (tmp_path / "simulated-B-0.png").stat().st_size > 10_000
    assert "imm:0.8" in capsys.readouterr().out
