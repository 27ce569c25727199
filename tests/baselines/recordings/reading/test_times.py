"""Missing rows and gaps between times; forms of times: `test_everyday_files`."""

import numpy as np
import pandas as pd

ROWS = 40
SECONDS = 0.25 * np.arange(ROWS)
POSITIONS = np.column_stack([np.arange(ROWS), np.sqrt(np.arange(ROWS))])


def test_missing_rows_and_gaps(read, read_one):
    times = np.delete(SECONDS, [3, 4])
    times[20:] += 6.0
    positions = np.delete(POSITIONS, [3, 4], axis=0)
    frame = pd.DataFrame({"t": times, "x": positions[:, 0], "y": positions[:, 1]})
    frame.loc[[0, 7, 8, 19], "x"] = np.nan

    assert "4 rows without a position; 2 pieces between gaps" in read(frame).summary
    recording = read_one(frame)
    assert recording.pieces == ((1, 19), (20, 38))
    assert np.flatnonzero(~recording.measured).tolist() == [0, 7, 8, 19]
    assert np.isnan(recording.positions[7]).all()
    assert read_one(frame, gap=7.0).pieces == ((1, 38),)
    assert read_one(frame, gap=0.5).pieces == ((1, 3), (3, 7), (9, 19), (20, 38))
