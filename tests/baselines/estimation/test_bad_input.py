"""Input that is not allowed raises an error of one line that names the argument."""

import numpy as np
import pytest
from hostile_input import VALUES, accepted, profile, refused
from hypothesis import given
from hypothesis import strategies as st

from baselines.estimation.correction import Huber, StudentT
from baselines.estimation.gain_filters import AdaptiveFilter, GHFilter
from baselines.estimation.imm import IMMFilter
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from baselines.estimation.run_filter import run_filter
from baselines.estimation.smoother import smooth

CV = MotionModel("CV", 2, 1.0)
POINTS = np.zeros((5, 3, 2))
TIMES = np.arange(5.0)


def kalman(robust=None):
    return KalmanFilter(CV, 1.0, (1.0,), robust)


CALLS = {
    "name": lambda: MotionModel("CT", 2, 1.0),
    "axes": lambda: MotionModel("CV", 0, 1.0),
    "noise": lambda: MotionModel("CV", 2, (1.0, -1.0)),
    "discretization": lambda: MotionModel("CV", 2, 1.0, "other"),
    "model": lambda: KalmanFilter("CV", 1.0),
    "noise ": lambda: KalmanFilter(CV, [[1.0, 2.0], [2.0, 1.0]]),
    "noise  ": lambda: KalmanFilter(CV, 0.0),
    "noise   ": lambda: KalmanFilter(CV, [[1.0, 0.5], [0.4, 1.0]]),
    "start_deviations": lambda: KalmanFilter(CV, 1.0, (1.0, 2.0)),
    "start_deviations ": lambda: run_filter(KalmanFilter(CV, 1.0), POINTS, TIMES),
    "robust": lambda: kalman("huber"),
    "threshold": lambda: Huber(0.0),
    "degrees_of_freedom": lambda: StudentT(0.0),
    "measurements": lambda: run_filter(
        kalman(),
        np.full((5, 3, 2), np.inf),
        TIMES,
    ),
    "measurements ": lambda: run_filter(kalman(), np.zeros((5, 3, 3)), TIMES),
    "measurements  ": lambda: run_filter(kalman(), "text", TIMES),
    "times": lambda: run_filter(kalman(), POINTS, TIMES[:4]),
    "times[2]": lambda: run_filter(kalman(), POINTS, [0.0, 1.0, 0.5, 2.0, 3.0]),
    "noises": lambda: run_filter(
        kalman(),
        POINTS,
        TIMES,
        noises=np.zeros((5, 2, 2)),
    ),
    "start ": lambda: run_filter(kalman(), POINTS, TIMES, start=3),
    "start time": lambda: run_filter(
        kalman(),
        POINTS,
        TIMES,
        start=(np.zeros((3, 4)), np.eye(4), 1.0),
    ),
    "start estimates": lambda: run_filter(
        kalman(),
        POINTS,
        TIMES,
        start=(np.zeros((2, 4)), np.eye(4), 0.0),
    ),
    "covariance": lambda: run_filter(
        kalman(),
        POINTS,
        TIMES,
        start=(np.zeros((3, 4)), -np.eye(4), 0.0),
    ),
    "keep_covariances": lambda: run_filter(kalman(), POINTS, TIMES, keep_covariances=1),
    "track_filter": lambda: run_filter(CV, POINTS, TIMES),
    "tracks": lambda: kalman().begin(0),
    "dt": lambda: begun().predict(-1.0),
    "dt ": lambda: begun().predict([1.0, 2.0]),
    "measurement": lambda: begun().update([[1.0, 2.0, 3.0]]),
    "filters": lambda: IMMFilter([kalman()], 1.0),
    "filters ": lambda: IMMFilter([kalman(), KalmanFilter(MotionModel("CA", 2, 1.0), 1.0)], 1.0),
    "sojourns": lambda: IMMFilter([kalman(), kalman()], 0.0),
    "h": lambda: GHFilter(2, 1.0, 2.0),
    "g": lambda: GHFilter(2, 0.0, 0.0),
    "longest_gap": lambda: GHFilter(2, 0.5, 0.1, -1.0),
    "dt  ": lambda: run_filter(AdaptiveFilter(2, 1.0), POINTS, 2.0 * TIMES),
    "tau": lambda: AdaptiveFilter(2, 0.0),
    "model ": lambda: smooth(
        MotionModel("CA", 2, 1.0),
        run_filter(kalman(), POINTS, TIMES),
        TIMES,
    ),
    "filtered.covariances": lambda: smooth(
        CV,
        run_filter(GHFilter(2, 0.5, 0.1), POINTS, TIMES),
        TIMES,
    ),
}


def begun():
    one = kalman()
    one.begin(3)
    return one


@pytest.mark.parametrize("name", CALLS)
def test_message_names_the_argument(name):
    assert refused(CALLS[name]).startswith(name.strip())


@profile(300)
@given(st.sampled_from(VALUES), st.integers(0, 9))
def test_hostile_values_are_refused_in_one_line(value, place):
    actions = [
        lambda: MotionModel(value, 2, 1.0),
        lambda: MotionModel("CV", 2, value),
        lambda: KalmanFilter(CV, value),
        lambda: KalmanFilter(CV, 1.0, value),
        lambda: run_filter(kalman(), value, TIMES),
        lambda: run_filter(kalman(), POINTS, value),
        lambda: run_filter(kalman(), POINTS, TIMES, noises=value),
        lambda: run_filter(kalman(), POINTS, TIMES, start=(value, value, value)),
        lambda: IMMFilter(value, 1.0),
        lambda: IMMFilter([kalman(), kalman()], value),
    ]
    accepted(actions[place])
