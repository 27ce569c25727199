"""The programs that README, the start page and the gallery show first."""

import ast
import contextlib
import importlib
import io
import re
from pathlib import Path

import pytest

from agents import evaluate

ROOT = Path(__file__).parents[1]
README, START, GALLERY = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "docs/start.md", "docs/examples/example_03_train_and_watch.py")
)


def program(page, word):
    """Return the first program of a page that has a word."""
    programs = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    return next(text for text in programs if word in text)


def rewards(text):
    """Return the rewards of lines such as "at-once: -0.320" by what stands before the colon."""
    rows = re.findall(r"^\s*([\w, -]+): (-?\d\.\d{3})$", text, re.MULTILINE)
    return {name: float(value) for name, value in rows}


def run(text):
    """Run a program; return what it prints and its names."""
    printed = io.StringIO()
    names = {}
    with contextlib.redirect_stdout(printed):
        exec(text, names)
    return printed.getvalue(), names


def test_the_gallery_trains_as_the_start_page_for_fewer_steps():
    # The example runs whenever the site is built.
    assert program(START, "PPO").replace("range(6)", "range(3)") in GALLERY


def test_modes_of_the_readme_print_what_it_says():
    printed, _ = run(program(README, "LinearMode"))
    shown = "".join(f"    {line}\n" for line in printed.splitlines())

    assert printed.count("\n") == 3
    assert f"\n{shown}\n" in README


def test_the_rule_of_the_readme_declares_the_likeliest():
    import gymnasium as gym

    _, names = run(program(README, "hurried"))
    env = gym.make_vec("hybrid_env:HybridTrack-v0", num_envs=50)
    rows, _ = env.reset(seed=0)
    declared = names["hurried"](rows, 0.3)

    assert {0} < set(declared.tolist()) <= {0, 1, 2, 3}
    assert not names["hurried"](rows, 0.0).any()


@pytest.mark.study
def test_the_model_of_the_readme_earns_what_it_says(tmp_path, monkeypatch):
    # The program saves its model in the present folder.
    monkeypatch.chdir(tmp_path)
    run(program(README, "PPO"))
    told = float(re.search(r"PPO earns (\d\.\d+) per segment", README)[1])

    # Its rounding depends on the processor.
    assert evaluate("ppo.zip")["reward"].value == pytest.approx(told, abs=0.015)


@pytest.mark.study
def test_the_program_of_the_start_page_prints_what_it_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown, found = rewards(START), rewards(run(program(START, "PPO"))[0])
    assert list(found) == list(shown)
    # Rules have no chance in them. PPO has a seed, but its rounding depends on the processor.
    rules = "at-once", "sprt", "msprt"
    assert [found[name] for name in rules] == [shown[name] for name in rules]
    *_, last = (name for name in found if name.startswith("PPO"))
    assert found[last] == pytest.approx(shown[last], abs=0.015)
    assert found["at-once"] < 0.0 < 0.5 < found[last]


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs" / "examples").glob("*.py")), ids=lambda path: path.stem
)
def test_an_example_imports_names_that_exist(path):
    # Most of them take minutes.
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(
            ("hybrid_env", "baselines", "agents")
        ):
            module = importlib.import_module(str(node.module))
            assert [name.name for name in node.names if not hasattr(module, name.name)] == []
