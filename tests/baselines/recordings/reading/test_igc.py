"""Flight logs in the IGC format: what is read of them, and what is not."""

import gzip

import numpy as np
import pytest
from made_up_glider import PROJECTION, fly, made_up_log, write_log

from baselines.recordings.reading.igc import is_igc, parse_igc
from baselines.recordings.reading.read import read_recordings
from hybrid_env.checks import ArgumentError


@pytest.mark.parametrize(("digits", "error"), [(0, 1.4), (2, 0.014), (3, 0.0014)])
def test_positions_have_the_digits_of_the_log(digits, error):
    _, positions, altitudes = fly(0)
    log = parse_igc("log", write_log(positions, altitudes, digits=digits))
    found = PROJECTION.forward(log.latitudes, log.longitudes)
    assert 0.4 * error < np.abs(found - positions).max() < error
    assert log.step == pytest.approx(1.853 / 10**digits, rel=1e-3)
    np.testing.assert_array_equal(log.times, 43_200.0 + np.arange(len(positions)))
    assert np.abs(log.altitudes - altitudes).max() <= 0.5


def test_south_west_and_midnight():
    content = b"AXXX\nB2359583330000S07030600WA0000000100\nB0000023330100S07030500WV0000000103\n"
    log = parse_igc("log", content)
    assert log.times.tolist() == [86_398.0, 86_402.0]
    np.testing.assert_allclose(log.latitudes, [-33.5, -33.501_666_67])
    np.testing.assert_allclose(log.longitudes, [-70.51, -70.508_333_33])
    assert log.altitudes.tolist() == [100.0, 103.0]  # by satellites, as there is no pressure


@pytest.mark.parametrize("lines", [b"AXXX\nHFDTE010100\n", b"AXXX\n" + b"B1200004630000N00915000EA0000000000\n" * 3])
def test_a_log_without_positions_is_refused(lines):
    with pytest.raises(ArgumentError, match="log has"):
        parse_igc("log", lines)


def test_a_log_is_a_recording_without_the_name_of_the_pilot(tmp_path):
    path = tmp_path / "flight.igc.gz"
    path.write_bytes(gzip.compress(made_up_log(2)))
    file = read_recordings(path)
    (recording,) = file.recordings
    assert (len(recording.times), recording.unit) == (600, "m")
    assert "Nobody" not in file.summary + recording.name
    assert not is_igc(b"T,X,Y\n0,1,2\n")
