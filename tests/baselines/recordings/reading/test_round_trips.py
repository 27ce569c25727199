"""What pandas writes is what is read, bit for bit."""

import io

import numpy as np
import pandas as pd
import pytest
from hostile_input import profile
from hypothesis import given
from hypothesis import strategies as st

from baselines.recordings.reading.read import read_recordings

NUMBERS = st.floats(-1e9, 1e9, allow_subnormal=False) | st.integers(-1000, 1000).map(float)
CELLS = NUMBERS | st.just(float("nan"))


@st.composite
def frames(draw):
    """Rows of increasing times and positions with missing ones; at least two are measured."""
    rows = draw(st.integers(2, 12))
    times = sorted(draw(st.sets(st.floats(-1e5, 1e5, allow_subnormal=False), min_size=rows, max_size=rows)))
    cells = draw(st.lists(st.tuples(CELLS, CELLS), min_size=rows, max_size=rows))
    positions = np.array([*draw(st.tuples(*[st.tuples(NUMBERS, NUMBERS)] * 2)), *cells][:rows])
    frame = pd.DataFrame({"time": times, "x": positions[:, 0], "y": positions[:, 1]})
    return frame


@pytest.mark.parametrize("examples", [60, pytest.param(5_000, marks=pytest.mark.study)])
def test_what_pandas_writes_is_read(tmp_path, examples):
    path = tmp_path / "round_trip"

    @profile(examples)
    @given(
        frames(),
        st.sampled_from([(",", "."), ("\t", "."), (";", "."), (";", ","), ("\t", ","), ("|", ".")]),
        st.booleans(),
        st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
        st.sampled_from(["\n", "\r\n"]),
        st.permutations(["time", "x", "y", "note"]),
        st.sampled_from(["csv", "csv", "parquet"]),
    )
    def check(frame, marks, index, encoding, end, order, kind):
        frame = frame.assign(note="a b, c; d\te|f '\"")[order]
        if kind == "parquet":
            frame.to_parquet(path)
        else:
            buffer = io.StringIO()
            frame.to_csv(buffer, sep=marks[0], decimal=marks[1], index=index, lineterminator=end)
            path.write_bytes(buffer.getvalue().encode(encoding))
        [recording] = read_recordings(path, object_column="none", unit="m").recordings
        expected = frame[["x", "y"]].to_numpy(copy=True)
        expected[np.isnan(expected).any(axis=1)] = np.nan
        np.testing.assert_array_equal(recording.positions, expected)
        np.testing.assert_array_equal(recording.times, frame["time"])
        measured = [row for first, last in recording.pieces for row in range(first, last)]
        assert set(np.flatnonzero(recording.measured)) <= set(measured)

    check()
