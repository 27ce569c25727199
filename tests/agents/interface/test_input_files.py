"""YAML of users: what is no plain value is refused in one line, and times are not taken for
numbers.
"""

import pytest
from hostile_input import refused

from agents.interface.input_files import parse_yaml
from agents.training.recipe import load_recipe

ENV = "hybrid_env:HybridTrack-v0"
NO_VALUES = {
    "a time": "1:59:59",
    "an escape of a large number": r'"\UFFFFFFFF"',
    "a large number": "9" * 5000,
    "code": "!!python/object:os.system {}",
    "an infinite number": ".inf",
    "a text as a number": "!!float x",
    "a list as an ordered mapping": "!!omap [x]",
    # Without limits each one is as long as nine of the last one.
    "aliases that are merged": "{0: &a0 {x: 1}, "
    + ", ".join(f"{k + 1}: &a{k + 1} {{<<: [{', '.join([f'*a{k}'] * 9)}]}}" for k in range(12))
    + "}",
}


@pytest.mark.parametrize("kind", NO_VALUES)
def test_yaml_that_is_no_plain_value_is_refused_in_one_line(kind, tmp_path):
    text = NO_VALUES[kind]
    with pytest.raises(ValueError, match=r".+"):
        parse_yaml(text)
    path = tmp_path / "recipe.yml"
    path.write_text(f"default: {{algo: ppo, n_steps: {text}}}")
    refused(load_recipe, str(path), ENV)
    assert "set=" in refused(load_recipe, "ppo", ENV, [f"learning_rate={text}"])


def test_a_quoted_time_is_a_text_and_numbers_are_as_before():
    values = parse_yaml(
        r'{a: "1:59:59", b: 1.5, c: 1_000, d: 0x10, e: "\u00e4\U0001F600", f: 1e-3, g: -0.5}'
    )
    assert values == {
        "a": "1:59:59",
        "b": 1.5,
        "c": 1000,
        "d": 16,
        "e": "\u00e4\U0001f600",
        "f": "1e-3",
        "g": -0.5,
    }
