import errno
import os
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from agents.interface.output_files import (
    PART_PREFIX,
    STALE_AFTER,
    atomic_file,
    output_folder,
    write_json,
)
from hybrid_env.checks import ArgumentError


def one_line(error: pytest.ExceptionInfo[ArgumentError]) -> str:
    message = str(error.value)
    assert "\n" not in message
    assert len(message) <= 300
    return message


def test_a_planted_link_is_not_followed(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("untouched")
    monkeypatch.setattr("secrets.token_hex", lambda _: "0")
    link = tmp_path / f"{PART_PREFIX}0.part.csv"
    link.symlink_to(victim)
    with pytest.raises(ArgumentError) as caught, atomic_file(tmp_path / "a.csv"):
        raise AssertionError

    assert "File exists" in one_line(caught)
    assert victim.read_text() == "untouched"


def test_names_of_temporary_files_differ_and_a_long_name_can_be_written(tmp_path):
    path = tmp_path / ("n" * 250 + ".csv")
    with atomic_file(path) as first, atomic_file(path) as second:
        assert first != second
        assert first.name.startswith(PART_PREFIX)
        first.write_text("1")
        second.write_text("2")

    assert path.read_text() == "1"
    assert list(tmp_path.iterdir()) == [path]


def test_old_temporary_files_are_removed_and_no_others(tmp_path):
    names = [
        f"{PART_PREFIX}old.part.png",
        f"{PART_PREFIX}new.part.png",
        "old.part.png",
        ".old.1.part.png",
    ]
    for name in names:
        (tmp_path / name).write_text("")
    for name in names[:1] + names[2:]:
        os.utime(
            tmp_path / name,
            times=(0, os.stat(tmp_path / name).st_mtime - STALE_AFTER - 10),
        )
    write_json(tmp_path / "a.json", 1)

    assert {path.name for path in tmp_path.iterdir()} == {*names[1:], "a.json"}


@pytest.mark.parametrize(
    "target",
    [Path("/dev/null"), Path("/dev/full"), Path("/")],
)
def test_a_folder_or_a_device_is_not_replaced(target):
    before = target.stat()
    with pytest.raises(ArgumentError) as caught:
        write_json(target, 1)

    assert "not a folder or device" in one_line(caught)
    assert target.stat().st_mode == before.st_mode


def full_disk(part: Path) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(part))


def weights_into_no_folder(part: Path) -> None:
    # Raises a SafetensorError.
    save_file({"a": torch.zeros(2)}, part / "below a file")


@pytest.mark.parametrize("writer", [full_disk, weights_into_no_folder])
def test_an_error_of_the_writer_is_one_line_and_leaves_nothing(tmp_path, writer):
    with pytest.raises(ArgumentError) as caught, atomic_file(tmp_path / "a.png") as part:
        writer(part)
    assert "a.png" in one_line(caught)
    assert list(tmp_path.iterdir()) == []


def test_unusable_names_and_values_are_one_line(tmp_path):
    for path in (tmp_path / ("n" * 5000), tmp_path / "a\nb" / "c"):
        with pytest.raises(ArgumentError) as caught:
            write_json(path, 1)
        one_line(caught)
    for path in (Path("/dev/null/x"), tmp_path / ("n" * 5000), tmp_path / "a\0b"):
        with pytest.raises(ArgumentError) as caught:
            output_folder("out", path)
        one_line(caught)
    with pytest.raises(ArgumentError, match=r"a\.json is not written"):
        write_json(tmp_path / "a.json", [float("nan")])
