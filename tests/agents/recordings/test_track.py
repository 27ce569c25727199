"""The command `hybridtrack track`: its files."""

import builtins
import csv

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import OBJECTS

from agents.cli import main
from agents.recordings.command import Track
from agents.recordings.figure import MAX_POINTS, draw_recording, mode_lines
from agents.recordings.tracking import track_recording

CAR = OBJECTS["car"]
LENGTHS = (60, 50, 40, 70)


@pytest.fixture
def drive(tmp_path):
    """A recording of a car, R60 L50 S40 L70."""
    path = tmp_path / "drive.csv"
    points = CAR.simulate(1, 3, "RLSL", LENGTHS).measurements[0]
    pd.DataFrame({"t": CAR.times(220), "x": points[:, 0], "y": points[:, 1]}).to_csv(path, index=False)
    return path


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_known_lengths_give_a_row_for_each_piece(drive, capsys):
    Track(files=(drive,), lengths=LENGTHS, radii=(200.0,)).run()
    pieces = rows_of(drive.parent / "drive_track" / "modes.csv")
    assert [row["mode"] for row in pieces] == ["R", "L", "S", "L"]
    assert [row["radius"] for row in pieces] == ["200.0", "200.0", "", "200.0"]
    assert [(row["first_row"], row["last_row"]) for row in pieces] == [
        ("1", "60"), ("61", "110"), ("111", "150"), ("151", "220")
    ]  # fmt: skip
    for row in pieces:
        assert float(row["begin"]) <= float(row["decided_at"]) <= float(row["end"])
        assert row["undecided"] == "False"
    printed = capsys.readouterr().out
    assert "4 pieces by msprt-aware" in printed
    assert "track.png" in printed


def test_rows_have_modes_probabilities_estimates_and_covariances(drive):
    Track(files=(drive,)).run()
    folder = drive.parent / "drive_track"
    table = pd.read_csv(folder / "estimates.csv")
    given = pd.read_csv(drive)
    pd.testing.assert_frame_equal(table[["t", "x", "y"]], given)
    expected = track_recording(given["t"], given[["x", "y"]])
    names = np.array(["S", "L", "R"])
    assert (table["mode"] == names[expected.modes]).all()
    np.testing.assert_allclose(table[["p_S", "p_L", "p_R"]].sum(axis=1), 1.0)
    np.testing.assert_allclose(
        table[["estimate_x", "estimate_vx", "estimate_y", "estimate_vy"]], expected.estimates
    )
    np.testing.assert_allclose(table["cov_vx_y"], expected.covariances[:, 1, 2])
    truth = CAR.simulate(1, 3, "RLSL", LENGTHS).truth[0]
    errors = [np.hypot(*(table[columns].to_numpy() - truth[:, ::2]).T).mean() for columns in
              (["estimate_x", "estimate_y"], ["x", "y"])]  # fmt: skip
    assert errors[0] < 0.9 * errors[1]
    spread = np.sqrt(table["cov_x_x"] + table["cov_y_y"])
    assert 0.7 < errors[0] / spread.mean() < 1.2  # a Rayleigh mean is 0.89 of the root mean square
    assert (folder / "track.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_and_the_map_are_optional(drive):
    Track(files=(drive,), picture=False, html=True).run()
    folder = drive.parent / "drive_track"
    assert sorted(path.name for path in folder.iterdir()) == ["estimates.csv", "modes.csv", "track.html"]
    page = (folder / "track.html").read_text(encoding="utf-8")
    assert "decided by threshold" in page
    assert 'src="http' not in page  # no network
    assert "left" not in page[:200]


def test_the_map_needs_its_extra(drive, monkeypatch, capsys):
    plain = builtins.__import__

    def without_plotly(name, *rest, **more):
        if name.startswith("plotly"):
            raise ImportError(name)
        return plain(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without_plotly)
    assert main(["track", str(drive), "--html"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "hybrid-track[html]" in line
    assert list(drive.parent.iterdir()) == [drive]


def test_the_picture_has_a_bounded_number_of_points():
    points = CAR.simulate(1, 3, "RLSL" * 30, LENGTHS * 30).measurements[0]
    tracked = track_recording(
        None, np.tile(points, (4, 1)) + np.repeat(np.arange(4) * 1e4, len(points))[:, None]
    )
    lines = mode_lines(tracked, 2000)
    assert sum(len(rows) for _, rows in lines) < 2000 + 3 * len(tracked.pieces)
    assert MAX_POINTS < 100_000
    for (_, rows), (first, end, *_) in zip(lines, tracked.pieces, strict=True):
        assert rows[-1] == end - 1
        assert first - 1 <= rows[0] <= first
    figure = draw_recording(tracked)
    figure.draw_without_rendering()
    assert [axes.get_ylabel() for axes in figure.axes] == ["y [units]", "probability", "residual [sd]"]


def test_several_radii_have_names(drive):
    Track(files=(drive,), radii=(100.0, 200.0), picture=False).run()
    folder = drive.parent / "drive_track"
    assert {"p_S", "p_L_100", "p_R_200"} <= set(rows_of(folder / "estimates.csv")[0])
    assert {row["radius"] for row in rows_of(folder / "modes.csv") if row["mode"] == "S"} <= {""}
