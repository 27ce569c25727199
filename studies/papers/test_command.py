"""The command: the quick form of all papers, and the table of the page."""

import json
from pathlib import Path

import pytest

from agents import run_command
from studies.papers.__main__ import Reproduce

README = Path(__file__).parent / "README.md"


def reproduce(*arguments):
    assert run_command(Reproduce, "papers", list(map(str, arguments))) == 0


def between(marks):
    return README.read_text().split(f"<!-- {marks} -->\n")[1].split(f"<!-- /{marks} -->")[0]


def test_the_quick_form_writes_tables_and_figures(tmp_path):
    reproduce("--quick", "--out", tmp_path)
    cells = json.loads((tmp_path / "golubkov2018.json").read_text())["cells"]

    assert {cell["verdict"] for cell in cells} == {"inside", "outside"}
    assert len(list(tmp_path.glob("*.png"))) == 3 + 3 + 1 + 1
    assert (tmp_path / "reproduction.md").read_text().count("\n| ") == 7


@pytest.mark.study
def test_the_table_of_the_page_is_up_to_date(tmp_path):
    reproduce("--out", tmp_path)
    assert between("reproduction") == (tmp_path / "reproduction.md").read_text()


@pytest.mark.study
def test_the_comparison_of_the_page_is_up_to_date(tmp_path):
    shown = between("multiple models").splitlines()
    reproduce("multiple_models", "--out", tmp_path)
    printed = (tmp_path / "multiple_models.md").read_text().splitlines()

    assert len(shown) > 20
    assert [line for line in shown if line.startswith("|") and line not in printed] == []
