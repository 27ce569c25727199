"""What is searched: hyper-parameters of a recipe and their ranges."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.interface.input_files import parse_yaml
from agents.training.recipe import Recipe
from hybrid_env.checks import reject

DEFAULT_RANGES = {
    "ppo": ("learning_rate=0.0003..0.03", "n_epochs=1..10", "gae_lambda=0.8..0.99", "ent_coef=0.0..0.02"),
    "anchor": ("learning_rate=0.0003..0.03", "hidden=16..128", "smallest_alpha=0.0001..0.03"),
    "reward": ("learning_rate=0.0003..0.03", "hidden=16..128"),
    "tandem": ("learning_rate=0.0003..0.03", "hidden=16..128"),
    "kalman": ("learning_rate=0.0003..0.03", "hidden=8..64"),
    "distilled": ("learning_rate=0.0003..0.03", "hidden=16..128"),
    "transformer": ("learning_rate=0.0003..0.03", "hidden=16..128"),
    "statements": ("learning_rate=0.0003..0.03", "hidden=8..64"),
    "rhythm": ("learning_rate=0.0003..0.03", "hidden=8..64"),
    "flights": ("learning_rate=0.0003..0.03", "hidden=8..64"),
    "gliders": ("learning_rate=0.0003..0.03", "hidden=8..64"),
}
"""Ranges by algorithm; recurrent PPO has those of PPO."""

LINEAR_DECAY = "lin_"
"""Prefix of a learning rate that decays; a learning rate that is found keeps it."""

DIGITS = 3  # significant, of a number that is found
WIDE = 10.0  # ratio of the bounds of a positive range from which it is searched on a logarithmic scale


@dataclass(frozen=True)
class Range:
    """Values of a hyper-parameter.

    Attributes:
        name: of the hyper-parameter, as in `--set`.
        low, high: bounds, both integers for an integer.
        choices: instead of bounds, values as YAML.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    choices: tuple[str, ...] = ()

    def suggest(self, trial: Any) -> None:
        """Ask an Optuna trial for a value."""
        if self.choices:
            trial.suggest_categorical(self.name, self.choices)
        elif isinstance(self.low, int):
            trial.suggest_int(self.name, self.low, self.high, log=self._is_wide())
        else:
            trial.suggest_float(self.name, self.low, self.high, log=self._is_wide())

    def _is_wide(self) -> bool:
        return self.low > 0 and self.high / self.low >= WIDE

    def contains(self, value: Any) -> bool:
        """Return whether a value of an Optuna trial is in the range."""
        if self.choices:
            return value in self.choices
        return isinstance(value, type(self.low)) and self.low <= value <= self.high


def parse_range(text: str) -> Range:
    """Read "n_epochs=1..10", "gae_lambda=0.8..1.0" or "batch_size=512|1024".

    Raises:
        ArgumentError: another text.
    """
    error = reject("search", text, "name=low..high with numbers, low < high, or name=value|value")
    name, equals, values = text.partition("=")
    if not equals or not name:
        raise error
    if "|" in values:
        choices = tuple(values.split("|"))
        if not all(choices) or len(set(choices)) != len(choices):
            raise error
        return Range(name, choices=choices)
    bounds = values.split("..")
    try:
        if len(bounds) == 2 and all(re.fullmatch(r"[+-]?\d+", bound) for bound in bounds):
            found = Range(name, int(bounds[0]), int(bounds[1]))
        else:
            low, high = (float(bound) for bound in bounds)
            found = Range(name, low, high)
    except ValueError:
        raise error from None
    if not (np.isfinite([found.low, found.high]).all() and found.low < found.high):
        raise error
    return found


def parse_ranges(texts: Sequence[str], recipe: Recipe) -> tuple[Range, ...]:
    """Read ranges, those of the algorithm of a recipe if there are none.

    Raises:
        ArgumentError: an invalid text, or a name twice.
    """
    ranges = tuple(map(parse_range, texts or DEFAULT_RANGES[recipe.algo.removeprefix("recurrent_")]))
    names = [one.name for one in ranges]
    if len(set(names)) != len(names):
        raise reject("search", texts, "different names")
    return ranges


def values_of(recipe: Recipe, ranges: Sequence[Range]) -> dict[str, Any]:
    """Return the values of a recipe that are in the ranges, for a trial of what it is now."""
    entry = recipe.as_json()["entry"]
    values = {}
    for one in ranges:
        value = entry.get(one.name)
        if isinstance(value, str) and value.startswith(LINEAR_DECAY):
            value = float(value.removeprefix(LINEAR_DECAY))
        if not one.choices and isinstance(one.low, float) and isinstance(value, int):
            value = float(value)
        if one.contains(value):
            values[one.name] = value
    return values


def changes_of(values: Mapping[str, Any], recipe: Recipe) -> tuple[str, ...]:
    """Return the values of a trial as changes of a recipe, see `recipe.load_recipe`."""
    rate = recipe.as_json()["entry"].get("learning_rate")
    changes = []
    for name, value in values.items():
        text = str(value)
        if isinstance(value, float):
            rounded = float(f"{value:.{DIGITS}g}")
            text = np.format_float_positional(rounded, trim="0")  # YAML reads 1e-05 as a text
            if name == "learning_rate" and str(rate).startswith(LINEAR_DECAY):
                text = LINEAR_DECAY + text
        else:
            parse_yaml(text)
        changes.append(f"{name}={text}")
    return tuple(changes)
