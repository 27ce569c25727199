import numpy as np

from hybrid_env.live import MeasuredTracks, OnlineTrack
from hybrid_env.quickest_options import QuickestOptions

TRACKS, TICKS = 11, 30


def test_many_tracks_give_the_rows_of_each_alone():
    generator = np.random.default_rng(1)
    options = QuickestOptions()
    points = generator.normal(0.0, 1.0, (TICKS, TRACKS, 2)).cumsum(0)
    points[7, 3] = np.nan
    starts = generator.normal(0.0, 1.0, (TRACKS, 4))
    covariance = np.diag([0.1, 0.2, 0.1, 0.3])
    modes = generator.integers(-1, 3, TRACKS)
    stated = generator.integers(0, 3, (TICKS, TRACKS))
    together = MeasuredTracks(options, TRACKS)
    together.begin_all(starts, covariance, modes)
    alone = [OnlineTrack(options) for _ in range(TRACKS)]
    for track, one in enumerate(alone):
        one.begin_track(starts[track], covariance, int(modes[track]))
    for tick in range(TICKS):
        together.measure_all(points[tick])
        for track, one in enumerate(alone):
            one.measure(*points[tick, track])
        np.testing.assert_array_equal(
            together.take_rows(),
            np.vstack([one.take_rows() for one in alone]),
        )
        np.testing.assert_array_equal(
            together.field("estimate"),
            [one.estimate() for one in alone],
        )
        together.actions[:] = stated[tick]
        for track, one in enumerate(alone):
            one.decide(int(stated[tick, track]))
