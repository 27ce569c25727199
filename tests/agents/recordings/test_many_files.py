"""Many files in parallel, broken ones among them, and existing results."""

import gzip
import os
import pickle

import numpy as np
import pytest

from agents.cli import main
from agents.interface.output_files import write_table
from agents.recordings.command import Track
from agents.recordings.files import FileArguments, Report, object_folders, work_on_files
from hybrid_env.checks import ArgumentError, reject

ROWS = 60


def write(path, seed=0, **more):
    generator = np.random.default_rng(seed)
    x, y = np.cumsum(0.2 + 0.05 * generator.normal(size=(2, ROWS)), axis=1)
    write_table(path, {"t": 0.1 * np.arange(ROWS), "x": x, "y": y, **more})


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


BROKEN = {
    "decreasing.csv": b"t,x,y\n0,1,2\n1,2,3\n0.5,3,4\n",
    "duplicate.csv": b"t,x,y\n0,1,2\n1,2,3\n1,3,4\n",
    "one_point.csv": b"t,x,y\n0,1,2\n",
    "text.csv": b"t,x,y\n0,1,2\n1,east,3\n2,3,4\n",
    "empty.csv": b"",
    "cut_off.csv.gz": gzip.compress(b"t,x,y\n" + os.urandom(1000))[:-20],
    "infinite.csv": b"t,x,y\n0,1,2\n1,inf,3\n2,3,4\n",
    "garbage.csv": bytes(range(256)) * 4,
    "two_objects.csv": b"t,x,y\n0,1,2\n1,2,3\n0,100,2\n1,101,3\n",
    "degrees.csv": b"t,x,y\n0,37.5,55.5\n1,37.50001,55.50001\n2,37.50002,55.50002\n",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_recording_gets_one_line_and_changes_nothing(name, tmp_path, capsys):
    (tmp_path / name).write_bytes(BROKEN[name])
    assert main(["track", str(tmp_path / name)]) == 2
    captured = capsys.readouterr()
    [line] = captured.err.splitlines()
    assert line.startswith("hybridtrack: ")
    assert name in line
    assert captured.out == ""
    assert [path.name for path in tmp_path.iterdir()] == [name]
    if name in ("decreasing.csv", "duplicate.csv", "two_objects.csv"):
        assert "--object" in line
    if name == "degrees.csv":
        assert "--unit" in line


@pytest.mark.study
def test_parallel_results_are_those_of_the_serial_run_byte_for_byte(tmp_path, capsys):
    good = [tmp_path / f"f{k}.csv" for k in range(4)]
    for seed, path in enumerate(good):
        write(path, seed)
    (tmp_path / "text.csv").write_bytes(BROKEN["text.csv"])
    files = [str(path) for path in (good[0], tmp_path / "text.csv", *good[1:])]
    found = {}
    for jobs in ("1", "2"):
        assert main(["track", *files, "--jobs", jobs, "--out", str(tmp_path / jobs)]) == 2
        captured = capsys.readouterr()
        broken, total = [line for line in captured.err.splitlines() if line.startswith("hybridtrack: ")]
        assert "text.csv, line 3: x='east'" in broken
        assert total == "hybridtrack: 1 of 5 files is not tracked; the others are"
        found[jobs] = (contents(tmp_path / jobs), captured.out)
        read = [line for line in captured.out.splitlines() if "60 rows; 1 object; tick 0.1 s" in line]
        assert [path.name in line for path, line in zip(good, read, strict=True)] == [True] * 4
    assert found["1"] == found["2"]
    assert {path.parts[0] for path in found["1"][0]} == {f"f{k}_track" for k in range(4)}


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
    assert [path.name for path in object_folders(tmp_path, ["..", "a/b", "a:b"])] == ["1", "a_b", "a_b_3"]
    assert object_folders(tmp_path, ["car"]) == [tmp_path]


def test_output_folders(tmp_path):
    files = (tmp_path / "a.csv", tmp_path / "b.csv.gz")
    assert [path.name for path in FileArguments(files=files).folders()] == ["a_track", "b_track"]
    folders = FileArguments(files=files, out=tmp_path / "all").folders()
    assert folders == [tmp_path / "all" / "a_track", tmp_path / "all" / "b_track"]
    assert FileArguments(files=files[:1], out=tmp_path / "all").folders() == [tmp_path / "all"]
    with pytest.raises(ArgumentError, match=r"a.csv and .*a.gpx both have the output folder"):
        FileArguments(files=(files[0], tmp_path / "a.gpx")).folders()


def test_a_file_is_tracked_as_in_another_process(tmp_path):
    path = tmp_path / "walk.csv"
    write(path)
    work = Track(files=(), picture=False).track_file
    reports = [
        one(path, tmp_path / name)
        for name, one in (("here", work), ("sent", pickle.loads(pickle.dumps(work))))
    ]
    assert reports[0].lines == reports[1].lines
    assert "60 rows; 1 object; tick 0.1 s" in reports[0].lines[0]
    assert contents(tmp_path / "here") == contents(tmp_path / "sent")


def work(path, folder):
    if path.name == "b":
        raise reject("file", path.name, "another one")
    if path.name == "c":
        raise OSError(28, "No space left on device")
    return Report((f"{path.name} in {folder.name}",))


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.study)])
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
