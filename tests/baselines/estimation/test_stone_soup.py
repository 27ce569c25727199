"""The IMM filter as predictor and updater of Stone Soup, beside the bank of the environment."""

import datetime

import numpy as np
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState

from baselines import IMMPredictor, IMMUpdater
from hybrid_env import LiveTracks, QuickestOptions
from hybrid_env.modes import LinearMode

TAU, R, HAZARD = 0.1, 0.1, 0.02
START = datetime.datetime(2030, 1, 1)
F = np.kron(np.eye(2), [[1.0, TAU], [0.0, 1.0]])
NOISES = [np.kron(np.eye(2), np.diag([0.0, q])) for q in (1e-3, 0.05, 1.0)]
BEGIN = np.array([1.0, 2.0, -1.0, 0.5])
SPREAD = np.diag([0.3, 0.2, 0.3, 0.2])


def stone_soup_filter():
    models = [
        LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q)
        for Q in NOISES
    ]
    stay = np.full((3, 3), HAZARD / 2) + (1 - 1.5 * HAZARD) * np.eye(3)
    sensor = LinearGaussian(4, (0, 2), R * np.eye(2))
    return IMMPredictor(models, stay), IMMUpdater(sensor)


def step(predictor, updater, state, position, tick):
    time = START + datetime.timedelta(seconds=TAU * tick)
    detection = Detection(np.reshape(position, (2, 1)), timestamp=time)
    return updater.update(SingleHypothesis(predictor.predict(state, timestamp=time), detection))


def test_probabilities_and_estimates_are_those_of_the_bank_of_the_environment():
    modes = tuple(LinearMode(F, Q=Q, name=f"noise {k}") for k, Q in enumerate(NOISES))
    options = QuickestOptions(modes=modes, hazard=HAZARD, tau=TAU, measurement_variance=R)
    bank = LiveTracks(options)
    bank.begin(BEGIN, SPREAD)
    predictor, updater = stone_soup_filter()
    state = GaussianState(BEGIN[:, None], SPREAD, timestamp=START)
    steps = np.random.default_rng(0).normal((0.2, 0.05), 0.4, (60, 2))

    for tick, position in enumerate(BEGIN[::2] + steps.cumsum(0), start=1):
        bank.measure(position)
        state = step(predictor, updater, state, position, tick)
        weights = np.array([part.weight for part in state], float)
        np.testing.assert_allclose(weights, bank.probabilities(), atol=1e-6)
        np.testing.assert_allclose(np.array(state.mean, float).ravel(), bank.estimate(), rtol=1e-5)
        np.testing.assert_allclose(np.array(state.covar, float), bank.covariance(), atol=1e-5)
    # No outlier loses a model.
    for tick, place in enumerate([(1e3, -1e3), position], start=61):
        state = step(predictor, updater, state, place, tick)
    weights = np.array([part.weight for part in state], float)
    assert weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(), 1.0)
