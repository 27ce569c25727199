import errno

import pytest

from agents.interface.output_files import PART_PREFIX, atomic_file
from hybrid_env.checks import ArgumentError


def test_a_planted_link_is_not_followed(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("untouched")
    monkeypatch.setattr("secrets.token_hex", lambda _: "0")
    link = tmp_path / f"{PART_PREFIX}0.part.csv"
    link.symlink_to(victim)
    with pytest.raises(ArgumentError, match="File exists"), atomic_file(tmp_path / "a.csv"):
        raise AssertionError

    assert victim.read_text() == "untouched"


def fill_disk(part):
    part.write_bytes(b"incomplete")
    raise OSError(errno.ENOSPC, "No space left on device")


def test_an_error_of_the_writer_is_reported_and_leaves_nothing(tmp_path):
    with pytest.raises(ArgumentError, match=r"a\.png"), atomic_file(tmp_path / "a.png") as part:
        fill_disk(part)
    assert list(tmp_path.iterdir()) == []
