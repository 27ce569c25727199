"""What the tests of all studies use."""

import subprocess
import sys
from collections.abc import Callable

import pytest


@pytest.fixture
def run_study() -> Callable[..., str]:
    """A function that runs a study by its name and flags, and returns what it prints."""

    def run(name: str, *flags: str) -> str:
        command = [sys.executable, "-m", f"studies.{name}", *flags]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    return run
