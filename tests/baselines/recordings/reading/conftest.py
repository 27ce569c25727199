"""How the tests of reading write a file and read it again."""

import pandas as pd
import pytest

from baselines.recordings.reading.read import read_recordings


@pytest.fixture
def read(tmp_path):
    """Return a function that writes bytes, text or the CSV of a frame and returns what is read."""

    def read(content, name="walk.csv", **options):
        if isinstance(content, pd.DataFrame):
            content = content.to_csv(index=False)
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
        return read_recordings(tmp_path / name, **options)

    return read


@pytest.fixture
def read_one(read):
    """Return the same function for the only recording of a file."""

    def read_one(content, **options):
        [recording] = read(content, **options).recordings
        return recording

    return read_one
