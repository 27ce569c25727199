import errno
import os
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from agents.interface.output_files import (
    PART_PREFIX,
    atomic_file,
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
