"""A live tracker decides as `track` does on a file of the same measurements."""

import numpy as np
import pytest
from field_files import NAMES, make, write

from agents.recordings.tracking import TrackingArguments
from baselines import OnlineTracker, read_recordings

LOSSES = {"jitter": 0.2, "repeated": 0.05, "late": 0.05, "missing": 0.1}


def measured(recording, position):
    """A measurement of a sensor, as the live tracker of its recording takes it."""
    if recording.radar is None:
        return tuple(position)
    distance, azimuth = position
    return {0: (distance, np.radians(90.0 - azimuth))}


@pytest.mark.parametrize(("name", "losses"), [("drone", {}), *((name, LOSSES) for name in NAMES)])
def test_live_and_from_a_file_the_decisions_are_the_same(name, losses, tmp_path):
    rows = make(name, 11, **losses)
    for recording in read_recordings(write(rows, tmp_path)).recordings:
        tracked = TrackingArguments(live=True).track(recording)
        tracker = OnlineTracker.from_recording(tracked)
        arrived = rows.of(recording.name)
        # Each measurement has the number of its row in the file, whose rows are sorted.
        numbers = np.unique(arrived.times, return_inverse=True)[1].tolist()
        times = recording.times[numbers].tolist()
        seen = set()
        right = []
        compared = 0
        measurements = zip(
            numbers, times, arrived.positions.tolist(), arrived.modes.tolist(), strict=True
        )
        for number, time, position, true_mode in measurements:
            now = tracker.update(measured(recording, position), time)
            assert (now.status == "repeated") == (number in seen)
            seen.add(number)
            # Where a measurement is still to come, the file knows more.
            if now.status == "used" and now.decided and len(seen) == max(seen) + 1:
                assert now.mode == tracked.modes[number]
                np.testing.assert_allclose(
                    now.estimate,
                    tracked.estimates[number],
                    rtol=1e-6,
                    atol=1e-6 * np.sqrt(tracked.model.measurement_variance),
                )
                compared += 1
                letter = tracked.of_modes(np.array([now.mode]))[0].item()
                right.append("SLR".index(letter) == true_mode)
        # A late measurement hides up to three others.
        assert compared > 0.7 * len(seen)
        # The least of the mean shares of right rows of the files, less six standard deviations.
        assert np.mean(right) > 0.80
