"""A step of a copy does not move the original, of all objects that change arrays in place."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from own_modes import every_mode
from own_noise import Rounded

from baselines import BeamDecider, OnlineTracker, SPRTDecider, ThresholdDecider
from baselines.rules.propagated import RefilteringDecider
from hybrid_env import KalmanBank, QuickestOptions, WorldOptions
from hybrid_env.live import LiveTracks
from hybrid_env.wrappers import CompleteInfo

POINTS = np.array([[0.2, 0.0], [0.4, 0.1], [0.6, 0.1], [0.9, 0.2], [1.1, 0.4]])


def environment(env):
    """Return an environment after its reset, and the function that steps it."""
    env.reset(seed=3)
    tracks = getattr(env, "num_envs", 0)
    return env, lambda env, k: env.step(np.full(tracks, k % 2) if tracks else k % 2)[:2]


def live(options):
    track = LiveTracks(options)
    track.begin(np.array([0.0, 2.0, 0.0, 0.0]), np.eye(4))
    track.begin_segment(40)

    def step(track, k):
        track.measure(POINTS[k])
        return track.estimate(), track.probabilities()

    return track, step


def bank():
    bank_of_points = KalmanBank()
    bank_of_points.anchor([0.0, 2.0, 0.0, 0.0])
    return bank_of_points, lambda bank, k: bank.step(POINTS[k])


def tracker(options, decider, lag=None, points=POINTS):
    made = OnlineTracker(options, decider, lag=lag)
    return made, lambda tracker, k: tuple(tracker.update(points[k]))


HEIGHTS = np.column_stack([POINTS, 100.0 + POINTS[:, 0]])
CLIMBS = "straight, left 5, climb 0.5, descend 0.3"
QUICKEST = QuickestOptions()
KINDS = {
    "environment": lambda: environment(gym.make("HybridTrack-v0").unwrapped),
    "quickest environment": lambda: environment(gym.make("HybridTrackQuickest-v0").unwrapped),
    "modes and noise": lambda: environment(
        gym.make("HybridTrack-v0", modes=every_mode(), noise=Rounded()).unwrapped
    ),
    "quickest modes and noise": lambda: environment(
        gym.make("HybridTrackQuickest-v0", modes=every_mode(), noise=Rounded()).unwrapped
    ),
    "climbs": lambda: environment(gym.make("HybridTrack-v0", modes=CLIMBS).unwrapped),
    "quickest climbs": lambda: environment(
        gym.make("HybridTrackQuickest-v0", modes=CLIMBS).unwrapped
    ),
    "drawn frames": lambda: environment(
        gym.make("HybridTrackQuickest-v0", render_mode="rgb_array").unwrapped
    ),
    "vector environment": lambda: environment(gym.make_vec("HybridTrack-v0", 20, threads=2)),
    "complete info": lambda: environment(CompleteInfo(gym.make("HybridTrack-v0").unwrapped)),
    "live": lambda: live(QUICKEST),
    "announced live": lambda: live(WorldOptions()),
    "bank": bank,
    "tracker": lambda: tracker(QUICKEST, ThresholdDecider()),
    "tracker of a beam": lambda: tracker(QUICKEST, BeamDecider(QUICKEST, branches=5)),
    "tracker with heights": lambda: tracker(QUICKEST, ThresholdDecider(), points=HEIGHTS),
    "tracker with a lag": lambda: tracker(QUICKEST, ThresholdDecider(), lag=1),
    "announced tracker": lambda: tracker(WorldOptions(), SPRTDecider()),
    "tracker with filters": lambda: tracker(WorldOptions(), RefilteringDecider(WorldOptions())),
}


@pytest.mark.parametrize("make", KINDS.values(), ids=KINDS)
def test_a_step_of_a_copy_does_not_move_the_original(make):
    alone, step = make()
    expected = [step(alone, k) for k in range(len(POINTS))]
    for copied in (copy.copy, copy.deepcopy, lambda original: pickle.loads(pickle.dumps(original))):
        original, step = make()
        step(original, 0)
        for each in (copied(original), original):
            steps = [step(each, k) for k in range(1, len(POINTS))]
            for values, right in zip(steps, expected[1:], strict=True):
                np.testing.assert_equal(values, right)
