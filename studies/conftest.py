"""What the tests of all studies use."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def run_study() -> Callable[..., str]:
    """A function that runs a study by its name and flags, and returns what it prints."""

    def run(name: str, *flags: str) -> str:
        command = [sys.executable, "-m", f"studies.{name}", *flags]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    return run


@pytest.fixture
def quick_study(run_study: Callable[..., str], tmp_path: Path) -> Callable[..., tuple[str, Any]]:
    """A function that runs the quick form of a study, and returns what it prints and the values of
    its file.
    """

    def run(name: str, *flags: str, file: str = "") -> tuple[str, Any]:
        printed = run_study(name, *flags, "--quick", "--jobs", "1", "--out", str(tmp_path))
        path = tmp_path / f"{file or name}.md"
        assert path.read_text() in printed
        return printed, json.loads(path.with_suffix(".json").read_text())

    return run
