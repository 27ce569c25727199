"""README.md in the repository and as the description on a package index."""

import importlib.util
import re
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


def test_without_a_url_words_remain_and_pictures_are_left_out(description):
    text = description(README, None)
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", text))
    assert "![" not in text
    assert "- Start in five minutes and the environments" in text


def test_the_wheel_has_the_three_packages_only():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    chosen = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    packages = {name.partition(".")[0] for name in find_packages(str(ROOT), include=chosen)}
    assert packages == {"hybrid_env", "baselines", "agents"}


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 90


def test_another_distribution_with_a_package_of_our_name_is_said_in_one_line(monkeypatch, capsys):
    def foreign(name):
        raise ModuleNotFoundError(f"No module named {name!r}")

    packages = {"agents": [console.DISTRIBUTION, "other-agents"], "baselines": [console.DISTRIBUTION]}
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
    monkeypatch.setattr(console.importlib, "import_module", None)  # no command is loaded
    assert console.main() == 0
    assert capsys.readouterr().out == f"hybridtrack {console.metadata.version('hybrid-track')}\n"


def test_a_missing_extra_is_said_in_one_line(monkeypatch, capsys):
    def missing(name):
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    monkeypatch.setattr(console.importlib, "import_module", missing)
    monkeypatch.setattr(console.metadata, "packages_distributions", dict)
    monkeypatch.setattr(console.metadata, "requires", lambda name: ['torch>=2.8; extra == "agents"'])
    assert console.main() == 2
    advice = "torch is missing: this needs the extra [agents]: pip install 'hybrid-track[agents]'"
    assert capsys.readouterr().err == f"hybridtrack: {advice}\n"
