"""The command `hybridtrack track`: its files, many at a time, and existing results."""

from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import recorded_tracks
from recorded_tracks import OBJECTS, write_recording

from agents.cli import main
from agents.commands import track
from agents.commands.track import Track, object_folders
from agents.recordings.tracking import track_recording
from baselines.recordings.reading.modes import read_modes


@pytest.fixture
def drive(tmp_path):
    """A recording of a car, R60 L50 S40 L70."""
    return write_recording(tmp_path / "drive.csv", *recorded_tracks.drive())


def test_rows_have_modes_probabilities_estimates_and_covariances(drive):
    Track(files=(drive,), png=False).run()
    table = pd.read_csv(drive.parent / "drive_track" / "estimates.csv")
    given = pd.read_csv(drive)

    pd.testing.assert_frame_equal(table[["time", "x", "y"]], given, check_dtype=False)
    expected = track_recording(given["time"], given[["x", "y"]])
    assert (table["mode"] == np.array(["S", "L", "R"])[expected.modes]).all()
    np.testing.assert_allclose(table[["p_S", "p_L", "p_R"]], expected.probabilities)
    state = ["estimate_x", "estimate_vx", "estimate_y", "estimate_vy"]
    np.testing.assert_allclose(table[state], expected.estimates)
    np.testing.assert_allclose(table["cov_vx_y"], expected.covariances[:, 1, 2])


def test_rows_are_the_same_in_parts_and_in_a_parquet_file(drive, monkeypatch):
    Track(files=(drive,), png=False).run()
    monkeypatch.setattr(track, "ROWS", 100)
    out = drive.parent / "out"
    Track(files=(drive,), png=False, parquet=True, out=out).run()
    table = pd.read_csv(drive.parent / "drive_track" / "estimates.csv")
    rows = pd.read_parquet(out / "estimates.parquet")

    assert set(table["decided"]) == {True}
    assert rows["decided"].dtype == bool
    pd.testing.assert_frame_equal(rows.astype(table.dtypes), table, check_exact=True)
    assert read_modes(out).modes == {"drive": table["mode"].tolist()}
    Track(files=(drive,), png=False, overwrite=True, out=out).run()
    written = (drive.parent / "drive_track" / "estimates.csv").read_bytes()
    assert (out / "estimates.csv").read_bytes() == written
    assert not (out / "estimates.parquet").exists()


ROWS = 60


def write(path, seed=0, **more):
    generator = np.random.default_rng(seed)
    positions = np.cumsum(0.2 + 0.05 * generator.normal(size=(ROWS, 2)), axis=0)
    write_recording(path, 0.1 * np.arange(ROWS), positions, **more)


def test_an_object_that_cannot_be_tracked_is_named_and_costs_no_other(tmp_path, capsys):
    path = tmp_path / "ships.csv"
    write(path, mmsi=["211"] * ROWS)
    ships = pd.read_csv(path)
    moored = ships.assign(mmsi="212", x=5.0, y=5.0)
    moored.to_csv(path, index=False)
    assert main(["track", str(path)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"hybridtrack: {path}: the ")
    assert list(tmp_path.iterdir()) == [path]

    pd.concat([moored, ships]).to_csv(path, index=False)
    assert main(["track", str(path), "--no-png"]) == 0
    printed = capsys.readouterr().out
    assert "  warning: 212: the " in printed
    assert "  warning: 1 of 2 objects not tracked\n  211: " in printed
    assert set(pd.read_csv(tmp_path / "ships_track" / "modes.csv").object) == {211}


def test_existing_results_are_not_overwritten_without_a_word(tmp_path):
    path = tmp_path / "walk.csv"
    line = ["track", str(path), "--no-png"]
    results = tmp_path / "walk_track" / "estimates.csv"
    write(path)

    assert main(line) == 0
    before = results.read_text()
    write(path, seed=1)
    assert main(line) == 2
    assert results.read_text() == before
    assert main([*line, "--overwrite"]) == 0
    assert results.read_text() != before


def test_each_object_has_its_own_folder(tmp_path):
    path = tmp_path / "ships.csv"
    write(path, mmsi=["211/a"] * (ROWS // 2) + ["211"] * (ROWS // 2))

    known = ["--measurement-variance", "0.01", "--no-png"]
    assert main(["track", str(path), *known]) == 0
    assert {path.name for path in (tmp_path / "ships_track").iterdir()} == {"211_a", "211"}
    names = [path.name for path in object_folders(tmp_path, ["..", "a/b", "a:b"])]
    assert names == ["1", "a_b", "a_b_3"]


def test_names_are_no_formulas_of_a_spreadsheet_and_are_xml(tmp_path):
    places = OBJECTS["car"].geographic(47.0, 8.0).drop(columns="mode").iloc[:60]
    names = ["=1+1", "@SUM(1)", "-1", "a\x07b"]
    path = tmp_path / "cars.csv"
    pd.concat([places.assign(id=name) for name in names]).to_csv(path, index=False)
    Track(files=(path,), png=False, gpx=True).run()

    folders = object_folders(tmp_path / "cars_track", [name.replace("\x07", "_") for name in names])
    for name, folder in zip(names, folders, strict=True):
        written = f"'{name}" if name[0] in "=@-" else name.replace("\x07", "\ufffd")
        for file in ("modes.csv", "estimates.csv"):
            assert set(pd.read_csv(folder / file, dtype=str)["object"]) == {written}
        assert f"<name>{written.strip(chr(39))}</name>" in (folder / "track.gpx").read_text()
        ElementTree.parse(folder / "track.gpx")
