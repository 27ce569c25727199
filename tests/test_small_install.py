"""The built wheel in environments of its own: what the base install and each extra promise.

The extras dev and docs serve a clone, where `make test` and `make docs` install them.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pandas as pd
import pytest

from agents.cli import main
from agents.commands import COMMANDS

ROOT = Path(__file__).parents[1]
SOURCES = ("hybrid_env", "baselines", "agents", "setup.py", "README.md", "LICENSE")
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]
LARGE = {"torch", "pandas", "matplotlib", "rich", "tyro", "pyarrow", "optuna", "pygame-ce"}
MISSING = r"hybridtrack: .+ is missing: this needs the extra \[{0}\]: pip install '.+\[{0}\]'"
# What runs once the extras up to this one are installed. Without the extra it is named.
COMMAND_LINES = {
    "agents": (
        "train --steps 1 --out ppo",
        "evaluate shipped --episodes 20",
        "compare ate --episodes 20 --out results",
        "play fixed:1 --out episode.gif",
    ),
    "recordings": ("track flight.csv --out tracked", "score truth.csv stated.csv"),
    "play": ("play fixed:1",),
    "all": (),
    "html": ("play fixed:1 --out episode.html", "track flight.csv --html --out page"),
    "recurrent": ("train --recipe recurrent-ppo --steps 1 --out recurrent",),
    "cluster": ("compare ate --episodes 20 --engine ray --out clustered",),
    "stonesoup": (),
}
# What each needs beside the base install only.
PROGRAMS = {
    "recordings": """
from baselines import read_recordings
for name in ("flight.csv", "flight.parquet", "walk.gpx"):
    [recording] = read_recordings(name).recordings
    assert len(recording.times) > 5
""",
    "play": """
import gymnasium
env = gymnasium.make("hybrid_env:HybridTrack-v0", render_mode="rgb_array")
env.reset(seed=0)
assert env.render().std() > 1.0
""",
    "stonesoup": "from baselines import IMMPredictor, IMMUpdater",
}

pytestmark = pytest.mark.study


def run(folder, *command):
    # Without a display.
    given = os.environ | {"SDL_VIDEODRIVER": "dummy"}
    given.pop("PYTHONPATH", None)
    return subprocess.run(
        [*map(str, command)], cwd=folder, capture_output=True, text=True, env=given
    )


def succeed(folder, *command):
    done = run(folder, *command)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("built")
    for name in ("pyproject.toml", *SOURCES):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    succeed(folder, sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", "dist", ".")
    [path] = (folder / "dist").glob("*.whl")
    return path


@pytest.fixture(scope="module")
def install(wheel):
    """A function that installs the wheel with an extra, and other packages, in the environment of
    a folder, and returns its interpreter.
    """

    def install(folder, extra="", *others):
        python = folder / "venv/bin/python"
        if not python.exists():
            venv.create(folder / "venv", with_pip=True)
        requirement = f"hybrid-track[{extra}] @ {wheel.as_uri()}"
        options = ("--no-compile", "-c", ROOT / "constraints.txt")
        succeed(folder, python, "-m", "pip", "install", *options, requirement, *others)
        return python

    return install


@pytest.fixture(scope="module")
def python(tmp_path_factory, install):
    """The interpreter of the base install, beside a copy of the tests and of the pages that they
    run, without the packages.
    """
    folder = tmp_path_factory.mktemp("installed")
    shutil.copytree(ROOT / "tests", folder / "tests")
    shutil.copytree(ROOT / "docs/environments", folder / "docs/environments")
    shutil.copy(ROOT / "pyproject.toml", folder)
    return install(folder, "", "pytest", "hypothesis")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with files of the commands."""
    folder = tmp_path_factory.mktemp("files")
    scheme = ["--scheme", "S50 L60r5 R75r5", "--measurement-variance", "0.02"]
    flight = str(folder / "flight.csv")
    assert main(["play", *scheme, "--out", str(folder / "flight.png"), "--record", flight]) == 0
    assert main(["track", flight, "--out", str(folder / "flight_track")]) == 0
    pd.read_csv(flight).to_parquet(folder / "flight.parquet")
    points = "".join(f'<trkpt lat="55.00{k}" lon="3"/>' for k in range(9))
    walk = f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>'
    (folder / "walk.gpx").write_text(walk)
    (folder / "truth.csv").write_text("time,mode\n0,walk\n5,run\n9,run\n")
    (folder / "stated.csv").write_text("time,mode\n0,walk\n6,run\n9,run\n")
    return folder


def test_every_extra_is_tried():
    assert {*COMMAND_LINES, "dev", "docs"} == {*EXTRAS}
    assert {line.split()[0] for lines in COMMAND_LINES.values() for line in lines} == {*COMMANDS}


def test_the_base_install_has_few_packages_and_says_which_extra_is_missing(python):
    listed = succeed(python.parent, python, "-m", "pip", "list", "--format", "freeze").lower()
    names = {line.partition("==")[0] for line in listed.splitlines()}
    command = python.with_name("hybridtrack")

    assert {"gymnasium", "numba", "numpy", "scipy", "hybrid-track"} <= names
    assert not names & LARGE
    assert succeed(python.parent, command, "--version").startswith("hybridtrack ")
    assert "pip install 'hybrid-track[agents]'" in succeed(python.parent, command, "--help")
    for name in COMMANDS:
        assert f"hybridtrack {name}" in succeed(python.parent, command, name, "--help")
        refused = run(python.parent, command, name)
        assert refused.returncode == 2
        assert re.fullmatch(MISSING.format("agents"), refused.stderr.rstrip("\n"))


def test_the_base_install_passes_the_checker_and_runs_the_live_tracker(python, folder):
    [program] = re.findall(
        r"```python\n([^`]*OnlineTracker[^`]*)```", (ROOT / "README.md").read_text("utf-8")
    )
    checked = 'check_env(gymnasium.make("hybrid_env:HybridTrack-v0").unwrapped)'
    imported = "import gymnasium; from gymnasium.utils.env_checker import check_env"

    succeed(folder, python, "-W", "error", "-c", f"{imported}; {checked}")
    told = succeed(folder, python, "-c", program)
    assert told.count("\n") == len((folder / "flight.csv").read_text().splitlines()) - 1


def test_environments_rules_and_live_tracker_need_the_base_install_only(python):
    succeed(
        python.parents[2],
        python,
        *("-m", "pytest", "-q"),
        *("--ignore", "tests/hybrid_env/rendering"),
        # These run a tool of the clone, find deciders as the commands do, and compare with studies
        # and agents.
        *("--ignore", "tests/hybrid_env/core/test_bitcode.py"),
        *("--ignore", "tests/baselines/rules/test_external.py"),
        *("--ignore", "tests/baselines/rules/test_adaptive_beam.py"),
        *("--ignore", "tests/baselines/rules/test_propagation.py"),
        "tests/hybrid_env",
        "tests/baselines/rules",
        "tests/baselines/scoring",
    )


@pytest.mark.parametrize("extra", PROGRAMS)
def test_an_extra_is_enough_for_python(extra, install, folder, tmp_path):
    succeed(folder, install(tmp_path, extra), "-c", PROGRAMS[extra])


def test_commands_need_the_extra_that_they_name(install, folder, tmp_path):
    python = install(tmp_path)
    command = python.with_name("hybridtrack")
    for extra, lines in COMMAND_LINES.items():
        for line in lines:
            refused = run(folder, command, *line.split())
            assert refused.returncode == 2, line
            # After lines of the progress.
            assert re.fullmatch(MISSING.format(extra), refused.stderr.splitlines()[-1])
            assert "Traceback" not in refused.stderr
        packages = succeed(folder, python, "-m", "pip", "freeze")
        install(tmp_path, extra)
        if extra == "all":
            assert succeed(folder, python, "-m", "pip", "freeze") == packages
        for line in lines:
            succeed(folder, command, line.split()[0], "--help")
            succeed(folder, command, *line.split())
