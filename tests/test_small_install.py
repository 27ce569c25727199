"""The built wheel in an environment of its own, with the base dependencies only."""

import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = (
    "hybrid_env",
    "baselines",
    "agents",
    "pyproject.toml",
    "setup.py",
    "README.md",
    "LICENSE",
)
FOLDERS = ("tests/hybrid_env", "tests/baselines/rules", "tests/baselines/scoring")

pytestmark = pytest.mark.study


def run(*command, cwd):
    return subprocess.run(
        [*map(str, command)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """The interpreter of the environment, beside a copy of the tests without the packages."""
    folder = tmp_path_factory.mktemp("installed")
    source = folder / "source"
    source.mkdir()
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, source / name)
    build = run(
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "-w",
        folder,
        source,
        cwd=folder,
    )
    assert build.returncode == 0, build.stderr
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=True)
    shutil.copytree(ROOT / "tests", folder / "tests")
    shutil.copy(ROOT / "pyproject.toml", folder)
    interpreter = folder / "venv/bin/python"
    pip = (interpreter, "-m", "pip", "install", "-c", ROOT / "constraints.txt")
    installed = run(*pip, wheel, "pytest", "hypothesis", cwd=folder)
    assert installed.returncode == 0, installed.stderr
    return interpreter


def test_the_base_install_has_few_packages_and_says_which_extra_is_missing(python):
    listed = (
        run(
            python,
            "-m",
            "pip",
            "list",
            "--format",
            "freeze",
            cwd=python.parent,
        )
        .stdout.lower()
        .splitlines()
    )
    names = {line.partition("==")[0] for line in listed}

    assert {"gymnasium", "numba", "numpy", "scipy", "hybrid-track"} <= names
    assert not names & {
        "torch",
        "pandas",
        "matplotlib",
        "rich",
        "tyro",
        "pyarrow",
        "optuna",
        "pygame-ce",
    }
    command = python.with_name("hybridtrack")
    version = run(command, "--version", cwd=python.parent)
    assert (version.returncode, version.stdout.split()[0]) == (0, "hybridtrack")
    for name in ("play", "compare", "--help"):
        found = run(command, name, cwd=python.parent)
        assert found.returncode == 2
        assert found.stderr.splitlines() == [
            "hybridtrack: tyro is missing: this needs the extra [agents]: pip install"
            " 'hybrid-track[agents]'"
        ]


def test_environments_rules_and_live_tracker_need_the_base_install_only(python):
    folder = python.parents[2]
    tests = run(
        python,
        "-m",
        "pytest",
        "-q",
        "--ignore",
        "tests/hybrid_env/rendering",
        *FOLDERS,
        cwd=folder,
    )

    assert tests.returncode == 0, tests.stdout[-3000:]
