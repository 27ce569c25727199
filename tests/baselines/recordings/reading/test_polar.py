"""Columns of range and azimuth are those of a radar, whose standard deviations are found."""

import numpy as np
import pandas as pd
import pytest

from hybrid_env.checks import ArgumentError

ROWS = 4000
# Turns, seen from all sides: azimuths go over 360 degrees.
HEADING = np.cumsum(np.where(np.arange(ROWS) // 60 % 2 == 0, 0.0, 0.04))
PATH = np.cumsum(np.column_stack([np.sin(HEADING), np.cos(HEADING)]), axis=0)
PATH = PATH - PATH.mean(axis=0)


def polar(step, tick, range_deviation, azimuth_deviation):
    """Times, ranges and azimuths of an object that moves by a step in each tick."""
    noise = np.random.default_rng(4).normal(size=(2, ROWS))
    # Not too near to the radar.
    x, y = step * PATH.T + 40.0 * step
    return pd.DataFrame(
        {
            "time": tick * np.arange(ROWS),
            "range": np.hypot(x, y) + range_deviation * noise[0],
            "azimuth": (np.degrees(np.arctan2(x, y)) + azimuth_deviation * noise[1]) % 360.0,
        }
    )


@pytest.mark.parametrize(
    ("step", "tick", "range_deviation", "azimuth_deviation"),
    [(480.0, 4.0, 28.0, 0.21), (0.4, 0.1, 0.03, 0.9)],
)
def test_standard_deviations_are_found(read, step, tick, range_deviation, azimuth_deviation):
    frame = polar(step, tick, range_deviation, azimuth_deviation)
    assert np.abs(np.diff(frame.azimuth)).max() > 350.0
    # Rows of another object between them.
    both = pd.concat([frame.assign(id="a"), frame.assign(id="b", range=frame.range + 9.0 * step)])
    for table in (frame, both.sort_values("time", kind="stable")):
        file = read(table)
        radar = file.recordings[0].radar
        # The standard error of 4,000 measurements is 2.7 %.
        assert radar.range_deviation == pytest.approx(range_deviation, rel=0.1)
        assert np.degrees(radar.bearing_deviation) == pytest.approx(azimuth_deviation, rel=0.1)
        assert "range and azimuth of a radar: standard deviations" in file.summary
        assert "deg are found; give them by --radar" in file.summary
    # The advice gives the same.
    length, angle = file.summary.split("--radar '")[1].split("'")[0].split()
    assert float(length) == pytest.approx(radar.range_deviation, rel=0.01)
    assert float(angle) == pytest.approx(radar.bearing_deviation, rel=0.01)


def test_other_positions_come_first_and_rounded_ranges_need_the_option(read):
    frame = polar(480.0, 4.0, 28.0, 0.21)
    [recording] = read(frame.assign(x=frame.time, y=1.0, distance=2.0, rng=3.0)).recordings
    assert recording.radar is None
    with pytest.raises(ArgumentError, match=r"standard deviations are not seen.*--radar"):
        read(frame.assign(range=(frame.range / 5e3).round() * 5e3))
