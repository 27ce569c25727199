"""What `hybridtrack track` writes is joined to what it has read, and scored."""

import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import OBJECTS, drive, write_recording

from agents.cli import main
from baselines.recordings.projection import Projection
from baselines.recordings.reading.read import read_recordings
from baselines.recordings.tracker import OnlineTracker

PLACES = {"walker": (47.5, 8.5), "aircraft": (-17.0, 179.999)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings of a walker and of an aircraft, true modes, and results, also of both in a
    file.
    """
    folder = tmp_path_factory.mktemp("round")
    tables = []
    for name, place in PLACES.items():
        table = OBJECTS[name].geographic(*place)
        table.loc[::20, ["lat", "lon"]] = np.nan
        table[["time", "mode"]].to_csv(folder / f"{name}-truth.csv", index=False)
        table.drop(columns="mode").to_csv(folder / f"{name}.csv", index=False)
        tables.append(table.assign(id=name))
    both = pd.concat(tables)
    both.drop(columns="mode").to_csv(folder / "both.csv", index=False)
    both[["id", "time", "mode"]].to_csv(folder / "both-truth.csv", index=False)
    files = [str(folder / f"{name}.csv") for name in PLACES]

    assert main(["track", str(folder / "both.csv"), "--no-png"]) == 0
    assert main(["track", *files, "--no-png", "--gpx", "--geojson", "--html"]) == 0
    return folder


def written(folder, name):
    """Estimates and pieces."""
    results = folder / f"{name}_track"
    return pd.read_csv(results / "estimates.csv"), pd.read_csv(results / "modes.csv")


def scored(folder, *files):
    """Figures of sets of statements."""
    out = folder / "score.json"
    paths = [str(folder / file) for file in files]
    assert main(["score", *paths, "--out", str(out)]) == 0
    return json.loads(out.read_text())["figures"]


@pytest.mark.parametrize("name", PLACES)
def test_results_are_joined_by_the_times_of_the_file_and_scored(folder, name):
    given = pd.read_csv(folder / f"{name}.csv")
    truth = pd.read_csv(folder / f"{name}-truth.csv")
    results, _ = written(folder, name)
    joined = given.merge(truth, on="time").merge(
        results, how="left", on="time", suffixes=("", "_stated")
    )
    measured = given["lat"].notna()

    assert joined.loc[measured, "mode_stated"].isin([*"SLR"]).all()
    np.testing.assert_array_equal(joined["lat_stated"], given["lat"])
    np.testing.assert_allclose(joined["lon_stated"], given["lon"], atol=1e-9)
    assert joined["line"].tolist() == list(range(2, len(given) + 2))
    right = (joined["mode"] == joined["mode_stated"]).to_numpy()[:-1].mean()
    figures = scored(folder, f"{name}-truth.csv", f"{name}_track/estimates.csv")
    assert figures["estimates"]["agreement"]["value"] == pytest.approx(right)
    assert right > 0.85


def test_pieces_have_the_times_and_places_of_their_rows(folder):
    results, pieces = written(folder, "walker")
    for moment, row in (("begin", "first_row"), ("end", "last_row")):
        rows = results.iloc[pieces[row] - 1].reset_index()
        assert (pieces[f"{moment}_time"] == rows["time"]).all()
        for axis in ("x", "y", "lat", "lon"):
            assert (pieces[f"{moment}_{axis}"] == rows[f"estimate_{axis}"]).all()

    assert (pieces["begin_low"] <= pieces["begin"]).all()
    assert (pieces["begin"] <= pieces["begin_high"]).all()
    assert (pieces["object"] == "walker").all()


def test_sets_of_several_objects_are_scored(folder):
    """Of a folder, of all its files, and of single ones, with words in place of letters."""
    truth = pd.read_csv(folder / "both-truth.csv")
    words = {"S": "Straight", "L": "left", "R": "right"}
    truth["mode"] = truth["mode"].map(words)
    truth.to_csv(folder / "words.csv", index=False)
    walker, aircraft = (f"both_track/{name}/estimates.csv" for name in PLACES)
    figures = scored(folder, "words.csv", walker, aircraft)

    assert list(figures) == ["both_track"]
    assert figures == scored(folder, "words.csv", "both_track")
    single = scored(folder, "walker-truth.csv", "walker_track/estimates.csv", walker)
    assert list(single) == ["walker_track", "both_track/walker"]
    assert single["walker_track"]["agreement"] == single["both_track/walker"]["agreement"]


DATES = pd.date_range("2026-05-01T23:59:50", periods=30, freq="500ms", tz="UTC")
ISO = [date.isoformat(timespec="milliseconds").replace("+00:00", "Z") for date in DATES]


@pytest.mark.parametrize(
    ("columns", "cells"),
    [
        ({"timestamp": [f"{second:.1f}" for second in DATES.as_unit("ms").asi8 / 1e3]}, None),
        ({"date": DATES.strftime("%d.%m.%Y"), "time": DATES.strftime("%H:%M:%S.%f")}, ISO),
        ({"time": DATES}, ISO),
        ({}, None),
    ],
)
def test_times_come_back_in_the_form_of_the_file(tmp_path, columns, cells):
    table = pd.DataFrame({**columns, "x": np.arange(30.0), "y": 0.0})
    path = tmp_path / "track.csv"
    dated = "date" not in columns and "time" in columns
    if dated:
        path = path.with_suffix(".parquet")
        table.to_parquet(path)
    else:
        table.to_csv(path, index=False)
    [recording] = read_recordings(path).recordings
    kept = recording.time_cells

    assert (kept is None) == (not columns)
    if columns:
        assert kept.tolist() == (cells or columns["timestamp"])
    first = 1 if dated else 2
    assert recording.lines.tolist() == list(range(first, first + 30))


def test_settings_in_a_file_are_those_of_a_live_tracker(folder):
    path = folder / "walker_track" / "track.json"
    settings = json.loads(path.read_text())
    live = OnlineTracker.from_recording(path)

    assert settings["epoch"] == "2026-05-01T23:50:01Z"
    assert settings["rows"] == 1000
    assert live.units.projection == Projection(**settings["projection"])
    assert live.mode_names == ["S", "L", "R"]
    now = live.update(PLACES["walker"], 0.0)
    assert now.position == pytest.approx(PLACES["walker"], abs=1e-8)


@pytest.mark.parametrize("name", PLACES)
def test_gpx_has_times_and_places_of_the_estimates(folder, name):
    results, pieces = written(folder, name)
    results = results.dropna(subset="estimate_x")
    [read] = read_recordings(folder / f"{name}_track" / "track.gpx").recordings
    steps = np.diff([read.positions, results[["estimate_x", "estimate_y"]]], axis=1)

    assert read.epoch == results["time"].iloc[0].replace(".000", "")
    np.testing.assert_allclose(np.diff(read.times), 1.0)
    # The planes have different centres.
    np.testing.assert_allclose(*np.hypot(*steps.T).T, rtol=1e-3, atol=1e-3)
    begins = [first for first, _ in read.pieces]
    assert begins == (pieces["first_row"] - pieces["first_row"][0]).tolist()


@pytest.mark.parametrize("name", PLACES)
def test_geojson_has_a_line_for_each_piece(folder, name):
    _, pieces = written(folder, name)
    text = (folder / f"{name}_track" / "track.geojson").read_text()
    features = json.loads(text)["features"]
    properties = pd.DataFrame([feature["properties"] for feature in features])
    lines = [np.array(feature["geometry"]["coordinates"]) for feature in features]

    pd.testing.assert_frame_equal(properties, pieces[properties.columns], check_dtype=False)
    for before, after in pairwise(lines):
        np.testing.assert_array_equal(before[-1], after[0])
    # No line goes around the world.
    assert max(np.ptp(line[:, 0]) for line in lines) < 1.0


@pytest.mark.parametrize("kind", ["gpx", "geojson"])
def test_a_plane_is_refused_where_degrees_are_needed(tmp_path, capsys, kind):
    path = write_recording(tmp_path / "drive.csv", *drive())

    assert main(["track", str(path), f"--{kind}"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert f"--{kind} needs latitude and longitude" in line
    assert list(tmp_path.iterdir()) == [path]
