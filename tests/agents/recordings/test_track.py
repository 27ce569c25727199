"""The command `hybridtrack track`: its files, many at a time, broken ones too, and existing
results.
"""

import csv

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import OBJECTS

from agents.cli import main
from agents.commands.track import Track, object_folders, work_on_files
from agents.recordings.tracking import track_recording
from hybrid_env.checks import ArgumentError, reject

CAR = OBJECTS["car"]
LENGTHS = (60, 50, 40, 70)


@pytest.fixture
def drive(tmp_path):
    """A recording of a car, R60 L50 S40 L70."""
    path = tmp_path / "drive.csv"
    points = CAR.simulate(1, 3, "RLSL", LENGTHS).measurements[0]
    pd.DataFrame(
        {
            "t": CAR.times(220),
            "x": points[:, 0],
            "y": points[:, 1],
        }
    ).to_csv(
        path,
        index=False,
    )
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
        ("1", "60"),
        ("61", "110"),
        ("111", "150"),
        ("151", "220"),
    ]
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
    np.testing.assert_allclose(
        table[["p_S", "p_L", "p_R"]].sum(axis=1),
        1.0,
    )
    np.testing.assert_allclose(
        table[["estimate_x", "estimate_vx", "estimate_y", "estimate_vy"]],
        expected.estimates,
    )
    np.testing.assert_allclose(table["cov_vx_y"], expected.covariances[:, 1, 2])
    truth = CAR.simulate(1, 3, "RLSL", LENGTHS).truth[0]
    errors = [
        np.hypot(*(table[columns].to_numpy() - truth[:, ::2]).T).mean()
        for columns in (["estimate_x", "estimate_y"], ["x", "y"])
    ]
    assert errors[0] < 0.9 * errors[1]
    spread = np.sqrt(table["cov_x_x"] + table["cov_y_y"])
    # A Rayleigh mean is 0.89 of the root mean square.
    assert 0.7 < errors[0] / spread.mean() < 1.2
    assert (folder / "track.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_and_the_map_are_optional_and_several_radii_have_names(drive):
    Track(
        files=(drive,),
        radii=(100.0, 200.0),
        picture=False,
        html=True,
    ).run()
    folder = drive.parent / "drive_track"

    assert {"p_S", "p_L_100", "p_R_200"} <= set(rows_of(folder / "estimates.csv")[0])
    assert {row["radius"] for row in rows_of(folder / "modes.csv") if row["mode"] == "S"} <= {""}
    assert sorted(path.name for path in folder.iterdir()) == [
        "estimates.csv",
        "modes.csv",
        "track.html",
    ]
    page = (folder / "track.html").read_text(encoding="utf-8")
    assert "decided by threshold" in page
    # No network.
    assert 'src="http' not in page
    assert "left" not in page[:200]


ROWS = 60


def write(path, seed=0, **more):
    generator = np.random.default_rng(seed)
    x, y = np.cumsum(
        0.2 + 0.05 * generator.normal(size=(2, ROWS)),
        axis=1,
    )
    table = pd.DataFrame(
        {
            "t": 0.1 * np.arange(ROWS),
            "x": x,
            "y": y,
            **more,
        }
    )
    table.to_csv(path, index=False, na_rep="nan")


def contents(folder):
    return {
        path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


BROKEN = {
    "duplicate.csv": ("t,x,y\n0,1,2\n1,2,3\n1,3,4\n", "--object"),
    "text.csv": ("t,x,y\n0,1,2\n1,east,3\n2,3,4\n", "line 3: x='east'"),
    "degrees.csv": ("t,x,y\n0,37.5,55.5\n1,37.50001,55.50001\n2,37.50002,55.50002\n", "--unit"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_recording_gets_one_line_and_changes_nothing(name, tmp_path, capsys):
    content, words = BROKEN[name]
    (tmp_path / name).write_text(content)

    assert main(["track", str(tmp_path / name)]) == 2
    captured = capsys.readouterr()
    [line] = captured.err.splitlines()
    assert line.startswith("hybridtrack: ")
    assert name in line
    assert words in line
    assert captured.out == ""
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_existing_results_are_not_overwritten_without_a_word(tmp_path, capsys):
    path = tmp_path / "walk.csv"
    write(path)

    assert main(["track", str(path)]) == 0
    before = contents(tmp_path / "walk_track")
    capsys.readouterr()
    write(path, seed=1)
    assert main(["track", str(path)]) == 2
    assert "walk_track' is not allowed: expected a new or empty folder, or --overwrite" in (
        capsys.readouterr().err
    )
    results = contents(tmp_path / "walk_track")
    assert results == before
    assert main(["track", str(path), "--overwrite"]) == 0
    assert contents(tmp_path / "walk_track") != results


def test_each_object_has_its_own_folder(tmp_path, capsys):
    path = tmp_path / "ships.csv"
    write(path, mmsi=["211/a"] * (ROWS // 2) + ["211"] * (ROWS // 2))

    assert main(["track", str(path), "--measurement-variance", "0.01"]) == 0
    assert "2 objects by 'mmsi'" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "ships_track").iterdir()} == {"211_a", "211"}
    assert [path.name for path in object_folders(tmp_path, ["..", "a/b", "a:b"])] == [
        "1",
        "a_b",
        "a_b_3",
    ]
    assert object_folders(tmp_path, ["car"]) == [tmp_path]


def work(path, folder):
    if path.name == "b":
        raise reject("file", path.name, "another one")
    if path.name == "c":
        raise OSError(28, "No space left on device")
    return [f"{path.name} in {folder.name}"], [], []


@pytest.mark.parametrize(
    "jobs",
    [1, pytest.param(2, marks=pytest.mark.study)],
)
def test_every_file_is_worked_on_whatever_happens_to_the_others(jobs, tmp_path, capsys):
    paths = [tmp_path / name for name in "abcd"]
    with pytest.raises(ArgumentError, match="2 of 4 files are not tracked; the others are"):
        work_on_files(work, paths, paths, jobs=jobs)
    captured = capsys.readouterr()

    assert captured.out.splitlines() == ["a in a", "d in d"]
    assert "b" in captured.err
    assert "No space left on device" in captured.err
    with pytest.raises(ArgumentError, match="file='b'"):
        work_on_files(work, paths[1:2], paths[1:2])
