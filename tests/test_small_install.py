"""The built wheel in an environment of its own, with the base dependencies only."""

import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ("hybrid_env", "baselines", "agents", "setup.py", "README.md", "LICENSE")
EXTRAS = {"torch", "pandas", "matplotlib", "rich", "tyro", "pyarrow", "optuna", "pygame-ce"}

pytestmark = pytest.mark.study


def run(folder, *command):
    return subprocess.run(
        [*map(str, command)],
        cwd=folder,
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """The interpreter of the environment, beside a copy of the tests without the packages."""
    folder = tmp_path_factory.mktemp("installed")
    shutil.copytree(ROOT / "tests", folder / "tests")
    for place in (folder, folder / "source"):
        place.mkdir(exist_ok=True)
        shutil.copy(ROOT / "pyproject.toml", place)
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / "source" / name)
    pip = ("-m", "pip")
    build = run(
        folder,
        sys.executable,
        *pip,
        "wheel",
        "--no-deps",
        "-w",
        folder,
        "./source",
    )
    assert build.returncode == 0, build.stderr
    venv.create(folder / "venv", with_pip=True)
    interpreter = folder / "venv/bin/python"
    line = (
        "install",
        "-c",
        ROOT / "constraints.txt",
        *folder.glob("*.whl"),
        "pytest",
        "hypothesis",
    )
    installed = run(
        folder,
        interpreter,
        *pip,
        *line,
    )
    assert installed.returncode == 0, installed.stderr
    return interpreter


def test_the_base_install_has_few_packages_and_says_which_extra_is_missing(python):
    listed = run(
        python.parent,
        python,
        "-m",
        "pip",
        "list",
        "--format",
        "freeze",
    ).stdout.lower()
    names = {line.partition("==")[0] for line in listed.splitlines()}

    assert {"gymnasium", "numba", "numpy", "scipy", "hybrid-track"} <= names
    assert not names & EXTRAS
    command = python.with_name("hybridtrack")
    assert run(
        python.parent,
        command,
        "--version",
    ).stdout.startswith("hybridtrack ")
    refused = run(
        python.parent,
        command,
        "play",
    )
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        "hybridtrack: tyro is missing: this needs the extra [agents]:"
        " pip install 'hybrid-track[agents]'"
    ]


def test_environments_rules_and_live_tracker_need_the_base_install_only(python):
    tests = run(
        python.parents[2],
        python,
        *("-m", "pytest", "-q"),
        *("--ignore", "tests/hybrid_env/rendering"),
        # It finds deciders as the commands do.
        *("--ignore", "tests/baselines/rules/test_external.py"),
        "tests/hybrid_env",
        "tests/baselines/rules",
        "tests/baselines/scoring",
    )

    assert tests.returncode == 0, tests.stdout[-3000:]
