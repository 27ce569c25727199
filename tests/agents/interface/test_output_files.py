import errno

import pytest

from agents.interface.output_files import atomic_file
from hybrid_env.checks import ArgumentError


def fill_disk(part):
    part.write_bytes(b"incomplete")
    raise OSError(errno.ENOSPC, "No space left on device")


def test_an_error_of_the_writer_is_reported_and_leaves_nothing(tmp_path):
    with pytest.raises(ArgumentError, match=r"a\.png"), atomic_file(tmp_path / "a.png") as part:
        fill_disk(part)
    assert list(tmp_path.iterdir()) == []
