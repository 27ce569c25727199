import numpy as np

from hybrid_env.live import LiveTracks
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
    together = LiveTracks(options, TRACKS)
    together.begin(starts, covariance, modes)
    alone = [LiveTracks(options) for _ in range(TRACKS)]
    for track, single in enumerate(alone):
        single.begin(starts[track], covariance, int(modes[track]))
    for tick in range(TICKS):
        together.measure_all(points[tick])
        for track, single in enumerate(alone):
            single.measure(points[tick, track])
        np.testing.assert_array_equal(
            together.world.take_rows(), np.vstack([single.world.take_rows() for single in alone])
        )
        np.testing.assert_array_equal(
            together.world.field("estimate"), [single.estimate() for single in alone]
        )
        together.world.actions[:] = stated[tick]
        for track, single in enumerate(alone):
            single.decide(int(stated[tick, track]))
