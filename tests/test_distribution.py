"""README.md in the repository and as the description on a package index."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path

import pytest
from setuptools import find_packages

from hybrid_env import console

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LINKS = re.findall(r"\]\(([^)]+)\)", README)


@pytest.fixture(scope="module")
def description():
    spec = importlib.util.spec_from_file_location("setup_script", ROOT / "setup.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.description


def test_relative_links_of_the_readme_exist():
    relative = [link for link in LINKS if "://" not in link]
    assert len(relative) > 5
    assert [link for link in relative if not (ROOT / link).is_file()] == []


def test_links_are_absolute_with_a_url_of_the_repository(description):
    text = description(README, "https://forge.example/group/project/")
    assert "](https://forge.example/group/project/blob/HEAD/docs/start.md)" in text
    assert "](https://forge.example/group/project/raw/HEAD/docs/compare.png)" in text
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", text))


def test_the_wheel_has_the_three_packages_only():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    chosen = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    packages = {name.partition(".")[0] for name in find_packages(str(ROOT), include=chosen)}

    assert packages == {"hybrid_env", "baselines", "agents"}


def test_another_distribution_with_a_package_of_our_name_is_said_in_one_line(monkeypatch, capsys):
    def foreign(name):
        raise ModuleNotFoundError(f"No module named {name!r}")

    packages = {
        "agents": [console.DISTRIBUTION, "other-agents"],
        "baselines": [console.DISTRIBUTION],
    }
    monkeypatch.setattr(console.metadata, "packages_distributions", lambda: packages)
    with monkeypatch.context() as patch:
        patch.setattr(console.importlib, "import_module", foreign)
        assert console.main() == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "'agents' of other-agents stands in the place of that of hybrid-track" in line
        packages["agents"].pop()
        with pytest.raises(ModuleNotFoundError):
            console.main()


def test_the_version_is_that_of_the_distribution(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["hybridtrack", "--version"])
    # No command is loaded.
    monkeypatch.setattr(console.importlib, "import_module", None)

    assert console.main() == 0
    assert capsys.readouterr().out == f"hybridtrack {console.metadata.version('hybrid-track')}\n"


def test_a_missing_extra_is_said_in_one_line(monkeypatch, capsys):
    def missing(name):
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    monkeypatch.setattr(console.importlib, "import_module", missing)
    monkeypatch.setattr(console.metadata, "packages_distributions", dict)
    monkeypatch.setattr(
        console.metadata,
        "requires",
        lambda name: ['torch>=2.8; extra == "agents"'],
    )

    assert console.main() == 2
    advice = "torch is missing: this needs the extra [agents]: pip install 'hybrid-track[agents]'"
    assert capsys.readouterr().err == f"hybridtrack: {advice}\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The built wheel; sources are copied, since a build writes beside them."""
    folder = tmp_path_factory.mktemp("wheel")
    skip = shutil.ignore_patterns(
        ".*",
        "tests",
        "docs",
        "build",
        "__pycache__",
        "*.egg-info",
        "runs",
        "results",
    )
    shutil.copytree(ROOT, folder / "source", ignore=skip)
    line = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        ".",
    ]
    subprocess.run([*line, "./source"], cwd=folder, check=True)
    (found,) = folder.glob("hybrid_track-*.whl")
    return found


@pytest.mark.study
@pytest.mark.parametrize("name", ["agents", "baselines"])
@pytest.mark.parametrize("in_place", [False, True])
def test_the_wheel_beside_a_foreign_package_says_so_in_one_line(name, in_place, wheel, tmp_path):
    line = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--target",
        tmp_path / "own",
        wheel,
    ]
    subprocess.run(line, check=True)

    def command(*arguments):
        # -S: an editable installation would also find modules inside of a foreign package.
        folders = tmp_path / "foreign", tmp_path / "own", sysconfig.get_path("purelib")
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
        line = [sys.executable, "-S", "-P", "-m", "hybrid_env.console", *arguments]
        return subprocess.run(
            line,
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )

    assert command("--version").returncode == 0
    place = tmp_path / ("own" if in_place else "foreign")
    # Another wheel was installed over this one.
    if in_place:
        (place / name / "__init__.py").write_text(
            "from agents.run import Runner\nfrom baselines.run import x\n"
        )
    else:
        (place / name).mkdir(parents=True)
        (place / name / "__init__.py").write_text("")
    about = place / f"other_{name}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: other-{name}\nVersion: 1.0\n")
    (about / "RECORD").write_text(f"{name}/__init__.py,,\n")
    result = command("evaluate", "ate", "--episodes", "2")
    assert result.returncode == 2
    (message,) = result.stderr.splitlines()
    assert f"'{name}' of other-{name} stands in the place of that of hybrid-track" in message
    assert message.endswith("in a virtual environment of its own")
