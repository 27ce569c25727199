"""The program that README, the start page and the gallery show first."""

import contextlib
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROGRAM = re.search(
    r"```python\n(.*?)```",
    README,
    re.DOTALL,
)[1]


def rewards(text):
    """Return the reward by name of the decider, of lines such as "ATE 0.382"."""
    rows = re.findall(
        r"^\s*([A-Z]+) (-?\d\.\d{3})$",
        text,
        re.MULTILINE,
    )
    return {name: float(value) for name, value in rows}


# The example of the gallery runs whenever the site is built, and trains for fewer steps.
@pytest.mark.parametrize(
    ("page", "steps"),
    [
        ("docs/start.md", "150_000"),
        ("docs/examples/example_03_train_and_watch.py", "40_000"),
    ],
)
def test_start_page_and_gallery_show_the_program_of_the_readme(page, steps):
    program = PROGRAM.replace("150_000", steps)
    assert program in (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.study
def test_the_program_prints_what_the_readme_says():
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(PROGRAM, {})
    shown, found = rewards(README), rewards(printed.getvalue())
    assert set(found) == set(shown) == {"PPO", "ATE", "SPRT"}
    # Rules have no chance in them. The seed of PPO is drawn; over five seeds its reward was 0.620
    # to 0.624.
    assert found["ATE"] == shown["ATE"]
    assert found["SPRT"] == shown["SPRT"]
    assert found["PPO"] == pytest.approx(shown["PPO"], abs=0.015)
    assert found["PPO"] > 0.6 > found["ATE"]
