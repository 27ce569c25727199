"""What is searched: hyper-parameters of a recipe and their ranges."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.interface.input_files import parse_yaml
from agents.training.recipe import Recipe
from hybrid_env.checks import reject

RATE = "learning_rate=0.0003..0.03"
DEFAULT_RANGES = {
    "ppo": (RATE, "n_epochs=1..10", "gae_lambda=0.8..0.99", "ent_coef=0.0..0.02"),
    "a2c": ("learning_rate=0.0001..0.01", "n_steps=8..128", "gae_lambda=0.8..0.99", "ent_coef=0.0..0.02"),
    "dqn": ("learning_rate=0.0001..0.01", "n_steps=1..32", "gradient_steps=1..8", "target_update_interval=1000..20000"),
    "qrdqn": ("learning_rate=0.0001..0.01", "n_steps=1..32", "gradient_steps=1..8", "exploration_final_eps=0.0..0.05"),
    "stopping": (RATE, "passes=2..12"),
    "anchor": (RATE, "hidden=16..128", "smallest_alpha=0.0001..0.03"),
    **dict.fromkeys(("reward", "tandem", "distilled", "transformer"), (RATE, "hidden=16..128")),
    **dict.fromkeys(("kalman", "statements", "rhythm", "jump_markov", "flights", "gliders"), (RATE, "hidden=8..64")),
}
"""Ranges by algorithm; recurrent PPO has those of PPO."""

LINEAR_DECAY = "lin_"  # a learning rate that is found keeps this prefix
DIGITS = 3  # significant, of a number that is found
WIDE = 10.0  # ratio of the bounds of a positive range from which it is searched on a logarithmic scale


@dataclass(frozen=True)
class Range:
    """Values of a hyper-parameter."""

    name: str  # as in `--set`
    low: float = 0.0  # an integer, as the other bound, for an integer
    high: float = 0.0
    choices: tuple[str, ...] = ()  # instead of bounds, values as YAML

    def suggest(self, trial: Any) -> None:
        """Ask an Optuna trial for a value."""
        if self.choices:
            trial.suggest_categorical(self.name, self.choices)
        else:
            suggest = trial.suggest_int if isinstance(self.low, int) else trial.suggest_float
            suggest(self.name, self.low, self.high, log=self.low > 0 and self.high / self.low >= WIDE)

    def contains(self, value: Any) -> bool:
        """Return whether a value of an Optuna trial is in the range."""
        if self.choices:
            return value in self.choices
        return isinstance(value, type(self.low)) and self.low <= value <= self.high


def parse_range(text: str) -> Range:
    """Read "n_epochs=1..10", "gae_lambda=0.8..1.0" or "batch_size=512|1024"."""
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
    kind = int if all(re.fullmatch(r"[+-]?\d+", bound) for bound in bounds) else float
    try:
        low, high = map(kind, bounds)
    except ValueError:
        raise error from None
    if not -math.inf < low < high < math.inf:
        raise error
    return Range(name, low, high)


def parse_ranges(texts: Sequence[str], recipe: Recipe) -> tuple[Range, ...]:
    """Read ranges, those of the algorithm of a recipe if there are none."""
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
