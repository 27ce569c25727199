"""Files of the field are tracked with nothing given, also those with gaps and losses."""

import numpy as np
import pytest
from field_files import NAMES, OBJECTS, make, write

from agents.recordings.tracking import TrackingArguments
from baselines import read_recordings

CLEAN = {}
ROUGH = {"jitter": 0.2, "repeated": 0.05, "late": 0.05, "missing": 0.1}
SEEDS = (1, 2)
# Mean share of right rows and its standard deviation from file to file, of the seeds 100 to 111.
RIGHT = {
    ("drone", "drone"): ((0.944, 0.004), (0.936, 0.005)),
    ("robot", "robot"): ((0.945, 0.005), (0.935, 0.007)),
    ("run", "Morning run"): ((0.941, 0.021), (0.930, 0.022)),
    ("radar", "radar"): ((0.957, 0.006), (0.944, 0.008)),
    ("harbour", "car"): ((0.967, 0.005), (0.959, 0.006)),
    ("harbour", "ship"): ((0.972, 0.014), (0.969, 0.015)),
}


def tracked(name, seed, losses, folder):
    """Share of right rows and the radii of each object of a file."""
    rows = make(name, seed, **losses)
    file = read_recordings(write(rows, folder))
    assert not file.warnings
    found = {}
    for recording in file.recordings:
        track = TrackingArguments().track(recording)
        # With dates, times are counted from the first row.
        first = rows.times.min() if recording.epoch else 0.0
        letters, _ = track.of_modes(track.modes)
        true = np.array(["S", "L", "R"])[rows.of(recording.name).modes_at(recording.times + first)]
        known = track.modes >= 0
        found[recording.name] = (letters == true)[known].mean(), known.mean(), track.model.radii
    return found


@pytest.mark.parametrize("rough", [0, 1], ids=["clean", "rough"])
@pytest.mark.parametrize("name", NAMES)
def test_modes_and_radii_of_a_file_alone(name, rough, tmp_path):
    found = [tracked(name, seed, (CLEAN, ROUGH)[rough], tmp_path) for seed in SEEDS]
    for who, target in OBJECTS[name].items():
        right, known, radii = zip(*(objects[who] for objects in found), strict=True)
        mean, deviation = RIGHT[name, who][rough]
        # Four standard errors of both means, and a percent for another tracker.
        error = deviation * np.sqrt(1.0 / len(SEEDS) + 1.0 / 12.0)
        assert np.mean(right) > mean - 4.0 * error - 0.01
        assert min(known) > 0.99
        for of_file in radii:
            assert min(abs(np.array(of_file) / target.radius - 1.0)) < 0.05
