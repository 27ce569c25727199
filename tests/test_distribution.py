"""README.md as the description on a package index, the wheel, and commands without an extra."""

import importlib.util
import re
import sys
import tomllib
from pathlib import Path

import pytest
from setuptools import find_packages

from agents.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_links_of_the_readme_are_absolute_on_an_index():
    links = [link for link in re.findall(r"\]\(([^)]+)\)", README) if "://" not in link]
    assert len(links) > 5
    spec = importlib.util.spec_from_file_location("setup_script", ROOT / "setup.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    text = script.description(README, "https://forge.example/group/project/")

    assert "](https://forge.example/group/project/blob/HEAD/docs/start.md)" in text
    assert "](https://forge.example/group/project/raw/HEAD/docs/compare.png)" in text
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", text))


def test_the_wheel_has_the_three_packages_only():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    chosen = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    packages = {name.partition(".")[0] for name in find_packages(str(ROOT), include=chosen)}

    assert packages == {"hybrid_env", "baselines", "agents"}


@pytest.mark.parametrize(
    ("module", "extra", "line"),
    [
        ("sb3_contrib", "recurrent", "train --recipe recurrent-ppo --steps 1 --out run"),
        ("ray", "cluster", "compare ate --engine ray --episodes 2 --no-curves --out results"),
        ("plotly", "html", "track walk.csv --html"),
    ],
)
def test_a_command_whose_package_is_missing_says_how_to_install_it(
    module, extra, line, monkeypatch, capsys, tmp_path
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    Path("walk.csv").write_text("x,y\n" + "1,2\n3,4\n" * 20)

    assert main(line.split()) == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert told.startswith("hybridtrack: ")
    assert module in told
    assert told.endswith(
        f" is missing: this needs the extra [{extra}]: pip install 'hybrid-track[{extra}]'"
    )
