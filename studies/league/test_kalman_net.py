"""KalmanNet: its density, and the Kalman filter that it learns on a linear Gaussian model."""

import numpy as np
import pytest
import torch

from studies.league.kalman import KalmanNet, normal_log_density

MOTION = torch.tensor([[1.0, 1.0], [0.0, 1.0]])
"""Of position and velocity."""
SENSOR = torch.eye(2)
START = torch.tensor([3.0, 0.5])
"""Deviations of the state at the beginning, around zero."""


def tracks(count, length, process, generator):
    """States and measurements (T, N, 2) with process variance `process` and measurement variance
    1.
    """
    state = START * torch.randn(
        count,
        2,
        generator=generator,
    )
    states = []
    for _ in range(length):
        state = state @ MOTION.T + process**0.5 * torch.randn(
            count,
            2,
            generator=generator,
        )
        states.append(state)
    states = torch.stack(states)
    return states, states + torch.randn(states.shape, generator=generator)


def kalman_filter(measurements, process):
    """Estimates (T, N, 2) and log-likelihoods (T, N) of the filter that knows all covariances."""
    motion = MOTION.double()
    identity = torch.eye(2, dtype=torch.double)
    mean = torch.zeros_like(measurements[0]).double()
    covariance = torch.diag(START.double().square())
    found = []
    logs = []
    for measurement in measurements.double():
        mean, covariance = mean @ motion.T, motion @ covariance @ motion.T + process * identity
        total = covariance + identity
        logs.append(torch.distributions.MultivariateNormal(mean, total).log_prob(measurement))
        gain = covariance @ torch.linalg.inv(total)
        mean, covariance = mean + (measurement - mean) @ gain.T, (identity - gain) @ covariance
        found.append(mean)
    return torch.stack(found), torch.stack(logs)


def filtered(net, start, measurements, scale):
    """Estimates (T, N, 2) and log-likelihoods (T, N) of the learned filter, from estimates (N,
    2).
    """
    last = net.start(start, start)
    found = []
    logs = []
    for measurement in measurements:
        last, log = net.step(
            last,
            MOTION,
            SENSOR,
            measurement,
            scale,
        )
        found.append(last.state)
        logs.append(log)
    return torch.stack(found), torch.stack(logs)


def compared(updates, length, process, hidden=32, seed=0):
    """Mean squared error and log-likelihood of the learned filter and of the Kalman filter on
    other tracks.
    """
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    generator = torch.Generator().manual_seed(seed)
    net = KalmanNet(
        2,
        2,
        hidden,
    )
    optimizer = torch.optim.Adam(net.parameters(), 1e-2)
    schedule = torch.optim.lr_scheduler.LinearLR(
        optimizer,
        1.0,
        0.02,
        updates,
    )

    def estimates(count):
        states, measurements = tracks(
            count,
            length,
            process,
            generator,
        )
        return (
            states,
            measurements,
            *filtered(
                net,
                torch.zeros(count, 2),
                measurements,
                torch.ones(count, 1),
            ),
        )

    for _ in range(updates):
        states, _, found, logs = estimates(64)
        loss = (found - states).square().mean() - logs.mean()
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    with torch.no_grad():
        states, measurements, found, logs = estimates(2000)
    best, exact = kalman_filter(measurements, process)
    errors = [float((each - states).square().mean()) for each in (found, best)]
    return *errors, float(logs.mean()), float(exact.mean())


def test_the_density_is_that_of_the_normal_law():
    generator = torch.Generator().manual_seed(1)
    values, logs, below = (
        torch.randn(
            5,
            n,
            generator=generator,
        )
        for n in (3, 3, 3)
    )
    inverse = torch.diag_embed(torch.exp(-12.0 * torch.tanh(logs / 12.0))).double()
    inverse[:, [1, 2, 2], [0, 0, 1]] = below.double()
    law = torch.distributions.MultivariateNormal(
        torch.zeros(3).double(),
        precision_matrix=inverse.mT @ inverse,
    )

    np.testing.assert_allclose(
        normal_log_density(
            values,
            logs,
            below,
        ),
        law.log_prob(values.double()),
        rtol=1e-4,
    )


def test_an_untrained_filter_predicts_and_its_units_do_not_matter():
    net = KalmanNet(
        2,
        2,
        8,
    )
    _, measurements = tracks(
        4,
        6,
        0.1,
        torch.Generator().manual_seed(2),
    )
    start = torch.ones(4, 2)
    found, _ = filtered(
        net,
        start,
        measurements,
        torch.ones(4, 1),
    )

    assert found.shape == (6, 4, 2)
    np.testing.assert_allclose(
        found[-1].detach(),
        start @ torch.matrix_power(MOTION, 6).T,
        rtol=1e-5,
    )
    torch.nn.init.normal_(
        net.gain[2].weight,
        std=0.3,
    )
    factor = 1000.0
    one, logs = filtered(
        net,
        start,
        measurements,
        torch.ones(4, 1),
    )
    other, scaled = filtered(
        net,
        factor * start,
        factor * measurements,
        torch.full((4, 1), factor),
    )
    np.testing.assert_allclose(
        other.detach(),
        factor * one.detach(),
        rtol=1e-3,
        atol=0.1,
    )
    np.testing.assert_allclose(
        scaled.detach(),
        logs.detach() - 2.0 * np.log(factor),
        rtol=1e-3,
        atol=1e-3,
    )


def test_the_gain_of_a_linear_model_is_learned_in_seconds():
    learned, best, log, exact = compared(
        200,
        12,
        0.1,
        16,
    )
    assert learned < 1.05 * best
    assert exact - log < 0.1


@pytest.mark.study
@pytest.mark.parametrize("process", [0.01, 0.1, 1.0])
def test_the_error_of_a_linear_model_is_within_five_per_cent_of_the_kalman_filter(process):
    learned, best, log, exact = compared(
        1000,
        50,
        process,
    )
    assert learned < 1.05 * best
    assert exact - log < 0.05
