"""The program that README, the start page and the gallery show first."""

import contextlib
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROGRAM = re.search(r"```python\n(.*?)```", README, re.DOTALL)[1]


def rewards(text):
    """Return the rewards of lines such as "at-once: -0.320" by what stands before the colon."""
    rows = re.findall(r"^\s*([\w, -]+): (-?\d\.\d{3})$", text, re.MULTILINE)
    return {name: float(value) for name, value in rows}


# The example of the gallery runs whenever the site is built, and trains for fewer steps.
@pytest.mark.parametrize(
    ("page", "steps"),
    [("docs/start.md", "range(11)"), ("docs/examples/example_03_train_and_watch.py", "range(5)")],
)
def test_start_page_and_gallery_show_the_program_of_the_readme(page, steps):
    program = PROGRAM.replace("range(11)", steps)
    assert program in (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.study
def test_the_program_prints_what_the_readme_says(tmp_path, monkeypatch):
    # The program saves its model in the present folder.
    monkeypatch.chdir(tmp_path)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(PROGRAM, {})
    shown, found = rewards(README), rewards(printed.getvalue())
    assert list(found) == list(shown)
    # Rules have no chance in them. PPO has a seed, but its rounding depends on the processor.
    rules = "at-once", "sprt", "msprt"
    assert [found[name] for name in rules] == [shown[name] for name in rules]
    *_, last = (name for name in found if name.startswith("PPO"))
    assert found[last] == pytest.approx(shown[last], abs=0.015)
    assert found["at-once"] < 0.0 < 0.5 < found[last]
