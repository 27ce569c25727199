"""The likelihood of the innovations, against filters in matrix form."""

import math

import numpy as np
import pytest
from recorded_tracks import OBJECTS

from baselines.recordings.decisions import first_state
from baselines.recordings.imm_pass import BURN_IN, NO_OUTPUT, PassOutput, imm_pass, make_chunks
from baselines.recordings.model_fit import fit_model
from baselines.recordings.recording import make_recording
from baselines.recordings.ticks import tick_grid
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.compilation import prepare
from hybrid_env.core.memory import LANES, ImmBank
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.simulation import simulate


def run_pass(parts, radii, model, switches=None, output=None):
    arguments = (
        make_chunks(parts, switches),
        bank_arrays(ImmBank, len(radii)),
        np.array(radii, float),
        model,
    )
    output = output or NO_OUTPUT
    prepare(imm_pass, *arguments, output)
    return imm_pass(*arguments, output)


def matrix_likelihood(z, R, Q):
    """Log-likelihood of a nearly constant velocity, from the third measurement after the start
    on.
    """
    F = np.kron(np.eye(2), [[1.0, 1.0], [0.0, 1.0]])
    G = np.diag([0.0, Q, 0.0, Q])
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    rows = np.flatnonzero(~np.isnan(z[:, 0]))
    first, second = rows[:2]
    apart = second - first
    velocity = (z[second] - z[first]) / apart
    x = np.array([z[second, 0], velocity[0], z[second, 1], velocity[1]])
    P = np.kron(
        np.eye(2),
        [[R, R / apart], [R / apart, 2 * R / apart**2 + apart * Q]],
    )
    total = 0.0
    seen = 2
    for k in range(second + 1, len(z)):
        x, P = F @ x, F @ P @ F.T + G
        if np.isnan(z[k, 0]):
            continue
        S = H @ P @ H.T + R * np.eye(2)
        innovation = z[k] - H @ x
        seen += 1
        if seen > 2 + BURN_IN:
            total -= 0.5 * (
                innovation @ np.linalg.solve(S, innovation)
                + math.log(np.linalg.det(2 * math.pi * S))
            )
        K = P @ H.T @ np.linalg.inv(S)
        x, P = x + K @ innovation, P - K @ H @ P
    return total


def test_lanes_without_a_chunk_and_earlier_passes_have_no_effect():
    part = np.cumsum(
        np.random.default_rng(1).normal(1.0, 0.3, (40, 2)),
        axis=0,
    )
    model = FilterModel(1.0, 0.01, 0.5, 0.5, 1.0 - 1.0 / 75.0, 0.5 / 75.0)
    alone = run_pass([part], [5.0], model)
    bank = bank_arrays(ImmBank, 1)
    for array in bank:
        array.view(np.float64)[...] = np.nan
    # The second block has one lane.
    chunks = make_chunks([part] * (LANES + 1))
    total = imm_pass(
        chunks,
        bank,
        np.array([5.0]),
        model,
        NO_OUTPUT,
    )

    assert total == pytest.approx((LANES + 1) * alone, rel=1e-13)


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_straight_motion_has_the_likelihood_of_a_matrix_filter(missing):
    rng = np.random.default_rng(0)
    parts = [
        np.cumsum(
            rng.normal(1.0, 0.3, (length, 2)),
            axis=0,
        )
        for length in (40, 40, 25)
    ]
    for part in parts:
        part[rng.random(len(part)) < missing] = np.nan
    total = run_pass(parts, [], FilterModel(1.0, 0.01, 0.5, 0.5))

    assert total == pytest.approx(
        sum(matrix_likelihood(part, 0.5, 0.01) for part in parts),
        rel=1e-9,
    )


def test_modes_are_free_again_at_a_known_switch_and_only_there():
    car = OBJECTS["car"]
    z = car.simulate(1, 3, "RL", (60, 60)).measurements[0] / car.deviation
    begins = np.zeros(120, np.bool_)
    begins[60] = True
    seen = {}
    for name, switches in (
        ("known", [begins]),
        ("never", None),
    ):
        output = PassOutput(
            np.full((1, 120, 2, LANES), np.nan),
            np.zeros((1, 120, 3, LANES)),
        )
        seen[name] = run_pass(
            [z],
            [car.radius / car.deviation],
            FilterModel(1.0, 1e-3, 1.0, 1.0),
            switches,
            output,
        )
        probabilities = output.probabilities[0, :, :, 0]
        assert probabilities[59, 2] > 0.99
        if name == "known":
            assert probabilities[60].max() < 0.7
            assert probabilities[100, 1] > 0.99

    assert seen["known"] > seen["never"] + 50.0


@pytest.mark.parametrize("mode", "SLR")
def test_the_state_before_the_first_measurement_is_found_backwards(mode):
    options = QuickestOptions(measurement_variance=0.01)
    word = "S50" if mode == "S" else f"{mode}50r5"
    errors = []
    for run in simulate(
        word,
        20,
        1,
        measurement_variance=0.01,
    ).measurements:
        estimate, covariance, first_mode = first_state(run, options, 0.0, np.full(len(run), np.nan))
        assert first_mode == "SLR".index(mode)
        error = estimate - [0.0, 0.0, 0.0, 2.0]
        errors.append(error @ np.linalg.solve(covariance, error))
    # Chi-square with 4 degrees of freedom: the mean of 20 has a standard deviation of 0.63.
    assert 4.0 - 4.0 * 0.63 < np.mean(errors) < 4.0 + 4.0 * 0.63


@pytest.mark.parametrize("name", OBJECTS)
def test_noise_and_radii_are_found_from_the_recording(name):
    moving = OBJECTS[name]
    run = moving.simulate(1, 2).measurements[0]
    model = fit_model(tick_grid(make_recording(moving.times(len(run)), run)))
    # R has a standard error of about 4 % with 2,000 coordinates; the bank explains switches by
    # noise.
    assert model.measurement_variance == pytest.approx(moving.measurement_variance, rel=0.2)
    assert 0.1 * moving.process_variance < model.process_variance < 10.0 * moving.process_variance
    assert model.radii == pytest.approx((moving.radius,), rel=0.15)
    assert 40.0 < model.duration < 200.0
    assert model.turns
