"""Flight logs in the IGC format: what is read of them, and what is not."""

import gzip

import numpy as np
import pytest
from made_up_glider import PROJECTION, fly, made_up_log, write_log

from baselines.recordings.reading.igc import is_igc, parse_igc


@pytest.mark.parametrize(("digits", "error"), [(0, 1.4), (3, 0.0014)])
def test_positions_have_the_digits_of_the_log(digits, error):
    _, positions, altitudes = fly(0)
    log = parse_igc("log", write_log(positions, altitudes, digits=digits))
    projected = PROJECTION.forward(log.latitudes, log.longitudes)

    assert 0.4 * error < np.abs(projected - positions).max() < error
    assert log.step == pytest.approx(1.853 / 10**digits, rel=1e-3)
    np.testing.assert_array_equal(log.times, 43_200.0 + np.arange(len(positions)))
    assert np.abs(log.altitudes - altitudes).max() <= 0.5


def test_south_west_and_midnight():
    content = b"AXXX\nB2359583330000S07030600WA0000000100\nB0000023330100S07030500WV0000000103\n"
    log = parse_igc("log", content)

    assert log.times.tolist() == [86_398.0, 86_402.0]
    np.testing.assert_allclose(log.latitudes, [-33.5, -33.501_666_67])
    np.testing.assert_allclose(log.longitudes, [-70.51, -70.508_333_33])
    # By satellites, as there is no pressure.
    assert log.altitudes.tolist() == [100.0, 103.0]


def test_a_log_is_a_recording_without_the_name_of_the_pilot(read):
    file = read(gzip.compress(made_up_log(2)), "flight.igc.gz")
    (recording,) = file.recordings

    assert (len(recording.times), recording.unit) == (600, "m")
    assert "Nobody" not in file.summary + recording.name
    assert not is_igc(b"T,X,Y\n0,1,2\n")


CLOCK = 43_200 + np.arange(120)


def log_at(clock):
    """A log with a position at every time of day [s]."""
    texts = [
        f"{time // 3600:02d}{time // 60 % 60:02d}{time % 60:02d}"
        for time in (np.array(clock) % 86_400).tolist()
    ]
    return ("AXXX\n" + "".join(f"B{text}4630000N00915000EA0010000100\n" for text in texts)).encode()


def with_clock(first, end, seconds):
    """Times of day of which some are wrong by a number of seconds."""
    return CLOCK + seconds * ((np.arange(120) >= first) & (np.arange(120) < end))


@pytest.mark.parametrize("seconds", [11 * 3600, -600])
@pytest.mark.parametrize(("first", "end"), [(50, 53), (117, 120), (0, 3)])
def test_a_few_positions_with_a_wrong_clock_do_not_take_others_along(first, end, seconds):
    log = parse_igc("log", log_at(with_clock(first, end, seconds)))
    assert set(CLOCK) - set(CLOCK[first:end]) <= set(log.times)
    # As before and after a gap.
    apart = (first == 0 and seconds < 0) or (end == 120 and seconds > 0)
    said = (f"positions left out whose time does not fit: {end - first}",)
    assert log.notes == (() if apart else said)


@pytest.mark.parametrize("hours", [-2, 11])
def test_a_clock_that_is_set_begins_a_new_piece_with_all_positions(hours):
    seconds = round(3600 * hours)
    log = parse_igc("log", log_at(with_clock(60, 120, seconds)))

    assert len(log.times) == 120
    steps = np.where(np.arange(119) == 59, seconds % 86_400 + 1, 1)
    np.testing.assert_array_equal(np.diff(log.times), steps)
    said = ("times that the clock was set back, where a new piece begins: 1",)
    assert log.notes == (said if hours < 0 else ())


@pytest.mark.parametrize("void", [5, 120])
def test_void_positions_are_left_out_unless_the_logger_has_no_others(read, void):
    file = read(log_at(CLOCK).replace(b"EA0", b"EV0", void), "flight.igc")

    left_out = {"rows of a sensor without a fix": void} if void < 120 else {}
    assert file.left_out == left_out
    assert len(file.recordings[0].times) == 120 - sum(left_out.values())
