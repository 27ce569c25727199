from pathlib import Path

import numpy as np
import pytest
from agents.interface.recording_files import read_recording, write_table

from agents.interface.output_files import atomic_file
from hybrid_env.checks import ArgumentError

ROWS = [[1.0, 2.0], [1.5, -2.25], [2.0, 4e-3]]


def write(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "flight.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    "content",
    [
        "x,y\n1,2\n1.5,-2.25\n2,4e-3\n",
        "1,2\n1.5,-2.25\n2,4e-3",
        "X;Y\r\n1;2\r\n1.5;-2.25\r\n2;4e-3\r\n\r\n  \r\n",
        "\ufeffY, name ,x\n2,a,1\n-2.25,b,1.5\n4e-3,,2\n",
        '"x","y"\n"1","2"\n1.5,-2.25\n2,.004\n,\n',
        "# x,y\n1,2\n1.5,-2.25\n2,4e-3\n",
    ],
)
def test_recording_without_times_has_no_tau(tmp_path: Path, content: str) -> None:
    recording = read_recording(write(tmp_path, content))
    np.testing.assert_array_equal(recording.measurements, ROWS)
    assert recording.measurements.dtype == np.float64
    assert recording.tau is None
    assert recording.times is None


@pytest.mark.parametrize(
    "content",
    [
        "t,x,y\n7,1,2\n7.25,1.5,-2.25\n7.5,2,4e-3\n",
        "7,1,2\n7.25,1.5,-2.25\n7.5,2,4e-3\n",
        "y;T;x\n2;7;1\n-2.25;7.25;1.5\n4e-3;7.5;2\n",
    ],
)
def test_tau_is_the_step_of_the_times(tmp_path: Path, content: str) -> None:
    recording = read_recording(write(tmp_path, content))
    np.testing.assert_array_equal(recording.measurements, ROWS)
    np.testing.assert_array_equal(recording.times, [7.0, 7.25, 7.5])
    assert recording.tau == 0.25


def test_times_may_deviate_by_a_thousandth_of_a_step(tmp_path: Path) -> None:
    assert read_recording(write(tmp_path, "0,0,0\n0.1,0,0\n0.20009,0,0\n0.3,0,0\n")).tau == pytest.approx(0.1)


def test_recording_of_one_row_has_no_tau(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path, "t,x,y\n3,1,2\n"))
    assert recording.measurements.shape == (1, 2)
    assert recording.tau is None


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("", ["file=", "empty"]),
        ("\n \n,,\n", ["file=", "empty"]),
        ("x,y\n", ["line 1", "'x,y'", "rows of numbers"]),
        ("x,y\n1,2\n1\n", ["line 3", "'1'", "2 cells as in line 1, not 1"]),
        ("1,2\n1,2,3\n", ["line 2", "'1,2,3'", "2 cells as in line 1, not 3"]),
        ("x,y\n1,2\n\n1,2\n", ["line 3", "blank"]),
        ("x,y\n1,two\n", ["line 2: y='two'", "finite number [m]"]),
        ("x;y\n1,5;2\n", ["line 2: x='1,5'", "decimal point"]),
        ("x,y\n1,\n", ["line 2: y=''", "finite number"]),
        ("1,two\n1,2\n", ["line 1: y='two'", "finite number"]),
        ("x,y\n1,2\nnan,2\n", ["line 3: x='nan'", "finite number"]),
        ("x,y\n1,2\n3,-inf\n", ["line 3: y='-inf'", "finite number"]),
        ("x,y\n1,1e300\n", ["line 2: y='1e300'", "1e+12"]),
        ("x,y\n1_0,1\n", ["line 2: x='1_0'", "finite number"]),
        ("t,x,y\n0,1,2\nsoon,1,2\n", ["line 3: t='soon'", "finite number [s]"]),
        ("east,north\n1,2\n", ["line 1: header='east,north'", "x and y once each"]),
        ("t,x,z\n1,2,3\n", ["line 1: header='t,x,z'", "x and y once each"]),
        ("x,y,X\n1,2,3\n", ["line 1: header='x,y,X'", "x and y once each"]),
        ("t,x,y,t\n1,2,3,4\n", ["line 1: header='t,x,y,t'", "t at most once"]),
        ("1,2,3,4\n", ["line 1: row='1,2,3,4'", "x,y or t,x,y"]),
        ("5\n6\n", ["line 1: row='5'", "x,y or t,x,y"]),
        ("x\ty\n1\t2\n", ["line 1: header=", "commas or semicolons"]),
        ('x,y\n1,2\n"1,2\n', ["line 3", "not CSV"]),
        (b"x,y\n1,2\n1,\xff\n", ["line 3", "0xff", "UTF-8"]),
        ("x,y\n1,2\n".encode("utf-16"), ["line 1", "0xff", "UTF-8"]),
        (b"\x89PNG\r\n\x1a\n\x00\x00", ["line 1", "0x89", "UTF-8"]),
        (b"x,y\n1,\x002\n", ["line 2", "0x00", "UTF-8"]),
        ("t,x,y\n0,1,2\n1,1,2\n0.5,1,2\n", ["line 4: t=0.5", "after 1 s"]),
        ("t,x,y\n0,1,2\n0,1,2\n", ["line 3: t=0.0", "after 0 s"]),
        ("t,x,y\n0,1,2\n.1,1,2\n.2,1,2\n.3003,1,2\n", ["line 5: t=0.3003", "uniform", "resample"]),
        ("t,x,y\n0,1,2\n.1,1,2\n.2,1,2\n.4,1,2\n", ["line 5: t=0.4", "expected 0.3", "resample"]),
    ],
)
def test_invalid_file_raises_with_file_and_line(
    tmp_path: Path, content: str | bytes, parts: list[str]
) -> None:
    path = write(tmp_path, content)
    with pytest.raises(ArgumentError, match=r"flight\.csv") as caught:
        read_recording(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_missing_file_or_folder_raises(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"nothing\.csv.*an existing CSV file"):
        read_recording(tmp_path / "nothing.csv")
    with pytest.raises(ArgumentError, match="not a folder"):
        read_recording(tmp_path)


def test_written_recording_is_read_back_exactly(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    times, positions = 1e-3 * np.arange(40), 1e3 * generator.normal(size=(40, 2))
    path = tmp_path / "flight.csv"
    write_table(path, {"y": positions[:, 1], "note": ["a,b"] * 40, "t": times, "x": positions[:, 0]})
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.measurements, positions)
    np.testing.assert_array_equal(recording.times, times)
    assert recording.tau == pytest.approx(1e-3, rel=1e-12)


def write_and_interrupt(path: Path) -> None:
    with atomic_file(path) as part:
        part.write_text("half")
        raise KeyboardInterrupt


def test_failed_write_leaves_the_folder_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    write_table(path, {"a": [1]})
    with pytest.raises(ArgumentError, match=r"columns=.*'a': 1, 'b': 2.*equal length"):
        write_table(path, {"a": [1], "b": [1, 2]})
    with pytest.raises(KeyboardInterrupt):
        write_and_interrupt(path)
    with pytest.raises(ArgumentError, match="can be written"):
        write_table(tmp_path / "no folder" / "table.csv", {"a": [1]})
    with pytest.raises(ArgumentError, match="can be written"):
        write_table(path / "below a file.csv", {"a": [1]})
    assert [entry.name for entry in tmp_path.iterdir()] == ["table.csv"]
    assert path.read_text() == "a\n1\n"
