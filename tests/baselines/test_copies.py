"""A step of a copy does not move the original, of all objects that change arrays in place."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest

from baselines import BeamDecider, OnlineTracker, SPRTDecider, ThresholdDecider
from baselines.estimation.imm import IMMFilter
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from baselines.rules.component_filters import ComponentFilters
from hybrid_env import KalmanBank, QuickestOptions, WorldOptions
from hybrid_env.live import LiveTracks
from hybrid_env.registration import ENVIRONMENTS
from hybrid_env.world import World, random_states
from hybrid_env.wrappers import CompleteInfo

POINTS = np.array([[0.2, 0.0], [0.4, 0.1], [0.6, 0.1], [0.9, 0.2], [1.1, 0.4]])


def environment(env):
    """Return an environment after its reset, and the function that steps it."""
    env.reset(seed=3)
    tracks = getattr(env, "num_envs", 0)
    return env, lambda env, k: env.step(np.full(tracks, k % 2) if tracks else k % 2)[:2]


def world(options):
    world = World(options, 9)
    world.seed(np.arange(9), random_states(range(9)))
    world.reset(np.ones(9, np.bool_))

    def step(world, k):
        world.actions[:] = k % 2
        world.step()
        return world.observations.copy()

    return world, step


def live(options):
    track = LiveTracks(options)
    track.begin(np.array([0.0, 2.0, 0.0, 0.0]), np.eye(4))
    track.begin_segment(40)

    def step(track, k):
        track.measure(POINTS[k])
        return track.estimate(), track.probabilities()

    return track, step


def measured():
    tracks = LiveTracks(QuickestOptions(), 3)
    tracks.begin(np.zeros((3, 4)), np.eye(4), 0)

    def step(tracks, k):
        tracks.measure_all(POINTS[[k] * 3])
        return tracks.world.observations.copy()

    return tracks, step


def bank():
    bank_of_points = KalmanBank()
    bank_of_points.anchor([0.0, 2.0, 0.0, 0.0])
    return bank_of_points, lambda bank, k: bank.step(POINTS[k])


def tracker(options, decider):
    return OnlineTracker(options, decider), lambda tracker, k: tracker.update(POINTS[k])[2:5]


def kinematic(track_filter):
    """Return a filter of two tracks, and a step in which one has no measurement: the other
    changes in place.
    """
    track_filter.begin(2)
    track_filter.update(POINTS[:2])

    def step(track_filter, k):
        track_filter.predict(0.1)
        track_filter.update(np.array([POINTS[k], [np.nan, np.nan]]))
        return track_filter.state.copy(), track_filter.log_likelihood.copy()

    return track_filter, step


def components():
    env = gym.make_vec("hybrid_env:HybridTrack-v0", 3)
    rows, _ = env.reset(seed=0)
    filters = ComponentFilters("anchor_aware", 1, 3, WorldOptions(), robust=True)
    every = np.ones(3, np.bool_)
    anchors = np.zeros((1, 3, 14))
    filters.advance(
        rows,
        every,
        anchors,
        np.zeros((3, 1)),
        every,
    )

    def step(filters, k):
        filters.advance(
            rows,
            ~every,
            anchors,
            np.zeros((3, 1)),
            ~every,
        )
        return filters.log_likelihood.copy()

    return filters, step


CV, QUICKEST = MotionModel("CV", axes=2, noise=1.0), QuickestOptions()
KINDS = {
    **{
        env_id: lambda env_id=env_id: environment(gym.make(env_id).unwrapped)
        for env_id in ENVIRONMENTS
    },
    **{
        f"3 {env_id}": lambda env_id=env_id: environment(gym.make_vec(env_id, 3))
        for env_id in ENVIRONMENTS
    },
    "drawn frames": lambda: environment(
        gym.make("HybridTrackQuickest-v0", render_mode="rgb_array").unwrapped
    ),
    "two threads": lambda: environment(gym.make_vec("HybridTrack-v0", 20, threads=2)),
    "complete info": lambda: environment(CompleteInfo(gym.make("HybridTrack-v0").unwrapped)),
    "world": lambda: world(WorldOptions()),
    "quickest world": lambda: world(QUICKEST),
    "live": lambda: live(QUICKEST),
    "announced": lambda: live(WorldOptions(recalculation=True)),
    "measured tracks": measured,
    "bank": bank,
    "tracker": lambda: tracker(QUICKEST, ThresholdDecider()),
    "tracker of a beam": lambda: tracker(QUICKEST, BeamDecider(QUICKEST, branches=5)),
    "announced tracker": lambda: tracker(WorldOptions(), SPRTDecider()),
    "Kalman filter": lambda: kinematic(KalmanFilter(CV, 0.1, start_deviations=[3.0])),
    "IMM": lambda: kinematic(
        IMMFilter([KalmanFilter(CV, 0.1, start_deviations=[3.0])] * 2, sojourns=10.0)
    ),
    "component filters": components,
}
COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda original: pickle.loads(pickle.dumps(original)),
}


@pytest.mark.parametrize("how", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("make", KINDS.values(), ids=KINDS)
def test_a_step_of_a_copy_does_not_move_the_original(make, how):
    alone, step = make()
    expected = [step(alone, k) for k in range(len(POINTS))]
    original, step = make()
    begun = step(original, 0)
    other = how(original)
    ahead = [step(other, k) for k in range(1, len(POINTS))]
    behind = [step(original, k) for k in range(1, len(POINTS))]
    for steps in (ahead, behind):
        for values, right in zip([begun, *steps], expected, strict=True):
            np.testing.assert_equal(values, right)
