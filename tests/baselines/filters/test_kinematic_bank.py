"""A bank of CV, CA and CJ: its likelihoods, its rows, and the decisions of the project's rules on them."""

import numpy as np
import pytest
from kinematic_worlds import draw, mean_bounds, simulate
from scipy.special import logsumexp

from baselines import FixedTimeDecider, GapDecider, MSPRTDecider, SPRTDecider, sprt_thresholds
from baselines.deciders.sprt import sprt_test
from baselines.filters.kalman import KalmanFilter
from baselines.filters.kinematic_bank import KinematicBank
from baselines.filters.motion_models import MotionModel
from baselines.filters.robust import Huber, StudentT
from baselines.filters.run_filter import run_filter
from baselines.recordings.kinematic_models import decide_models
from hybrid_env.observation import Layout

DEVIATIONS = (4.0, 1.0, 0.5)
NAMES = ("CV", "CA", "CJ")


def bank_of(axes=2, robust=None, noise=1.0):
    models = [MotionModel(name, axes, 0.001) for name in NAMES]
    return KinematicBank(
        [KalmanFilter(model, noise, DEVIATIONS[: model.order - 1], robust) for model in models]
    )


def flights(rng, bank, times, tracks, draw_noise):
    """True hypotheses (B,) and measurements; positions and velocities begin at N(0, diag(1, 16))."""
    truth = rng.integers(0, 3, tracks)
    measurements = np.empty((len(times), tracks, bank.axes))
    for h, one in enumerate(bank.filters):
        start = np.kron(np.eye(bank.axes), np.diag([1.0, *np.square(DEVIATIONS)])[: one.order, : one.order])
        states, _ = simulate(rng, one.model, times, start, np.eye(bank.axes), tracks)
        measurements[:, truth == h] = states[:, truth == h, :: one.order]
    return truth, measurements + draw_noise(rng, measurements.shape)


def gaussian(rng, shape):
    return rng.normal(size=shape)


def starts(bank, tracks):
    spread = np.kron(np.eye(bank.axes), np.diag([1.0, DEVIATIONS[0] ** 2]))
    return np.zeros((tracks, 2 * bank.axes)), spread, 0.0


@pytest.mark.parametrize("robust", [None, StudentT(), Huber()])
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_rows_state_the_likelihoods_of_the_filters(axes, robust):
    rng = np.random.default_rng(0)
    bank, tracks, times = bank_of(axes, robust), 6, np.cumsum(rng.uniform(0.3, 1.0, 12))
    _, measurements = flights(rng, bank, times, tracks, gaussian)
    measurements[4, 2] = np.nan
    start = starts(bank, tracks)
    likelihoods = []
    for one in bank.filters:
        spread = np.zeros((axes, one.order, axes, one.order))
        for axis in range(axes):
            spread[axis, :, axis, :] = np.diag([1.0, *np.square(DEVIATIONS)])[: one.order, : one.order]
        size = axes * one.order
        run = run_filter(
            KalmanFilter(one.model, 1.0, robust=robust), measurements, times,
            start=(np.zeros((tracks, size)), spread.reshape(size, size), 0.0),
        )  # fmt: skip
        likelihoods.append(run.log_likelihoods.cumsum(0))
    likelihoods = np.stack(likelihoods, axis=-1)
    bank.begin(*start[:2])
    layout = Layout(3)
    summed = np.zeros((tracks, 3))
    for k, dt in enumerate(np.diff(times, prepend=0.0)):
        bank.step(dt, measurements[k])
        np.testing.assert_allclose(bank.log_likelihood, likelihoods[k], rtol=1e-9, atol=1e-9)
        rows = bank.rows(np.zeros(tracks, np.int64))
        ratios = likelihoods[k] - likelihoods[k].max(-1, keepdims=True)
        np.testing.assert_allclose(layout.read(rows, "log_ratio"), np.maximum(ratios, -30.0), atol=1e-5)
        along, across = (layout.read(rows, f"innovation_{name}") for name in ("along", "across"))
        summed += -layout.read(rows, "log_variance") - 0.5 * (along**2 + across**2)
        np.testing.assert_allclose(summed - summed.max(-1, keepdims=True), ratios, rtol=1e-4, atol=1e-3)
        error = 1.0 - np.exp(ratios.max(-1) - logsumexp(ratios, axis=-1))
        np.testing.assert_allclose(
            np.exp(layout.read(rows, "log_error_probability")), error, rtol=1e-4, atol=1e-6
        )


def test_sprt_on_rows_equals_the_test_on_likelihoods():
    rng = np.random.default_rng(1)
    bank, tracks, times = bank_of(), 60, 0.5 * np.arange(1, 41)
    _, measurements = flights(rng, bank, times, tracks, gaussian)
    decisions = decide_models(bank, SPRTDecider(0.01), measurements, times, [40], starts(bank, tracks))
    upper, lower = sprt_thresholds(0.01)
    for track in range(tracks):
        running, winner = np.ones(3, np.bool_), -1
        for tick in range(40):
            winner = sprt_test(decisions.log_likelihoods[tick, track], running, 0, upper, lower)
            if winner >= 0:
                break
        assert decisions.undecided[track, 0] == (winner < 0)
        if winner >= 0:
            assert (decisions.decided[track, 0], decisions.ticks[track, 0]) == (winner, tick + 1)


@pytest.mark.parametrize(
    ("robust", "noise"), [(None, gaussian), (StudentT(3.0), lambda rng, shape: rng.standard_t(3.0, shape))]
)
def test_msprt_errs_as_often_as_it_says_in_the_world_of_the_bank(robust, noise):
    rng = np.random.default_rng(2)
    bank, tracks, times = bank_of(robust=robust), 800, 0.5 * np.arange(1, 51)
    truth, measurements = flights(rng, bank, times, tracks, noise)
    decisions = decide_models(bank, MSPRTDecider(0.1), measurements, times, [50], starts(bank, tracks))
    decided = ~decisions.undecided[:, 0]
    assert decided.mean() > 0.7
    wrong = (decisions.decided[:, 0] != truth)[decided]
    _, high = mean_bounds(0.1, 0.09, wrong.size)
    assert wrong.mean() < high  # the posterior error probability is at most alpha
    # the posterior of the last tick is the share of correct decisions
    last = decisions.log_likelihoods[-1]
    stated = np.exp(last.max(-1) - logsumexp(last, axis=-1))
    correct = last.argmax(-1) == truth
    low, high = mean_bounds(0.0, (stated * (1.0 - stated)).mean(), tracks)
    assert low < (correct - stated).mean() < high


@pytest.mark.parametrize(
    "decider", [SPRTDecider(0.02), MSPRTDecider(0.02), GapDecider(4.0), FixedTimeDecider(15)]
)
def test_rules_decide_several_segments_and_the_next_begins_at_the_estimate(decider):
    rng = np.random.default_rng(3)
    bank, tracks, times = bank_of(), 100, 0.5 * np.arange(1, 121)
    cv, ca = bank.filters[0].model, bank.filters[1].model
    first, _ = simulate(rng, ca, times[:60], np.kron(np.eye(2), np.diag([1.0, 16.0, 4.0])), np.eye(2), tracks)
    state = first[-1].reshape(tracks, 2, 3)[:, :, :2].reshape(tracks, 4)
    transition = np.kron(np.eye(2), [[1.0, 0.5], [0.0, 1.0]])
    second = []
    for _ in range(60):
        state = state @ transition.T + draw(rng, 0.0, np.kron(np.eye(2), 0.001 * cv.step_noise(0.5)), tracks)
        second.append(state)
    truth = np.concatenate([first[:, :, ::3], np.array(second)[:, :, ::2]])
    measurements = truth + rng.normal(size=truth.shape)
    decisions = decide_models(bank, decider, measurements, times, [60, 60], starts(bank, tracks))
    assert decisions.decided.shape == (tracks, 2)
    correct = decisions.decided == [1, 0]
    assert correct[:, 1].mean() > 0.85
    assert np.isin(decisions.decided[:, 0], (1, 2)).mean() > 0.85  # CA and CJ are alike
    after = (decisions.states[80:, :, ::4] - truth[80:])[:, correct[:, 1]]
    assert np.sqrt((after**2).mean()) < 1.0  # better than the measurements
    assert (decisions.modes[0] == 0).all()
