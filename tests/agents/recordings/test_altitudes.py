"""Altitudes of a file: columns and units, and climbs.csv."""

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import OBJECTS

from agents.cli import main
from agents.recordings.tracking import TrackingArguments
from baselines.recordings.projection import Projection
from baselines.recordings.reading.read import read_recordings

RATES = (8.0, 0.0, -2.0)


@pytest.fixture(scope="module")
def helix():
    """Times, positions and altitudes of an aircraft that climbs in a turn, and descends."""
    target = OBJECTS["aircraft"]
    positions = target.simulate(1, 3, "LSR", (100, 80, 120)).measurements[0]
    climbed = np.cumsum(np.repeat(RATES, (100, 80, 120))) * target.tau
    noise = 5.0 * np.random.default_rng(0).normal(size=len(climbed))
    return target.times(len(climbed)), positions, 1000.0 + climbed + noise


def test_a_helix_is_three_pieces_with_their_climb_rates(helix, tmp_path, capsys):
    times, positions, altitudes = helix
    lat, lon = Projection(46.0, 8.0).inverse(*positions.T).T
    feet = altitudes / 0.3048
    frame = {"time": times, "latitude": lat, "longitude": lon, "altitude_ft": feet}
    pd.DataFrame(frame).to_csv(tmp_path / "a.csv", index=False)
    assert main(["track", str(tmp_path / "a.csv"), "--out", str(tmp_path / "out")]) == 0
    assert "altitude: 1 climb at 8" in capsys.readouterr().out

    climbs = pd.read_csv(tmp_path / "out/climbs.csv")
    assert climbs.motion.tolist() == ["climb", "level", "descend"]
    np.testing.assert_allclose(climbs.climb_rate, RATES, atol=0.1)
    pieces = pd.read_csv(tmp_path / "out/modes.csv")
    np.testing.assert_allclose(pieces.climb_rate, RATES, atol=0.4)
    rows = pd.read_csv(tmp_path / "out/estimates.csv")
    errors = rows.estimate_altitude - 1000.0 - np.cumsum(np.repeat(RATES, (100, 80, 120)))
    assert np.sqrt(np.mean(errors**2)) < 1.5


def test_the_third_coordinate_is_an_altitude_upwards(helix, tmp_path):
    times, positions, altitudes = helix
    x, y = positions.T
    frames = {
        "enu": {"x [m]": x, "y [m]": y, "z [m]": altitudes},
        "ned": {"x [m]": y, "y [m]": x, "z [m]": -altitudes},
        "km": {"x [km]": x / 1e3, "y [km]": y / 1e3, "flight_level": altitudes / 30.48},
    }
    for name, columns in frames.items():
        pd.DataFrame({"t": times} | columns).to_csv(tmp_path / "b.csv", index=False)
        frame = name if name == "ned" else None
        [recording] = read_recordings(tmp_path / "b.csv", frame=frame).recordings
        scale = 1e-3 if name == "km" else 1.0
        np.testing.assert_allclose(recording.altitudes, scale * altitudes, rtol=1e-9)


def test_without_different_altitudes_there_are_no_climbs(helix, tmp_path):
    times, positions, _ = helix
    columns = {"t": times, "x [m]": positions[:, 0], "y [m]": positions[:, 1]}
    pd.DataFrame(columns | {"alt [m]": 7.0}).to_csv(tmp_path / "c.csv", index=False)
    file = read_recordings(tmp_path / "c.csv")
    assert "all altitudes are the same" in file.summary
    assert TrackingArguments().track(file.recordings[0]).vertical is None
