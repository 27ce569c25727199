"""The search: ranges of hyper-parameters; Optuna proposes trials, processes train them, and a
folder keeps them.
"""

import json
import math
import re
import statistics
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np
import optuna
import yaml
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from agents import evaluate, load_recipe, train
from hybrid_env import ArgumentError

# Of the reward during a training.
POINTS = 20
# Points before a training may end.
FIRST_POINT = 5
# That Optuna proposes; independent of the number of jobs, so that results are, too.
TRIALS_AT_A_TIME = 4
# That are all trained to their end, before others may end early.
FIRST_TRIALS = 5


RATE = "learning_rate=0.0003..0.03"
DEFAULT_RANGES = {
    "ppo": (RATE, "n_epochs=1..10", "gae_lambda=0.8..0.99", "ent_coef=0.0..0.02"),
    "a2c": (
        "learning_rate=0.0001..0.01",
        "n_steps=8..128",
        "gae_lambda=0.8..0.99",
        "ent_coef=0.0..0.02",
    ),
    "dqn": (
        "learning_rate=0.0001..0.01",
        "n_steps=1..32",
        "gradient_steps=1..8",
        "target_update_interval=1000..20000",
    ),
    "qrdqn": (
        "learning_rate=0.0001..0.01",
        "n_steps=1..32",
        "gradient_steps=1..8",
        "exploration_final_eps=0.0..0.05",
    ),
    "anchor": (RATE, "hidden=16..128", "smallest_alpha=0.0001..0.03"),
    "stopping": (RATE, "passes=2..12"),
    **dict.fromkeys(
        ("statements", "rhythm", "flights", "gliders"),
        (RATE, "hidden=8..64"),
    ),
}
"""Ranges by algorithm; recurrent PPO has those of PPO. Others need ranges of their own."""

# A learning rate that is found keeps this prefix.
LINEAR_DECAY = "lin_"
# Significant, of a number that is found.
DIGITS = 3
# Ratio of the bounds of a positive range from which it is searched on a logarithmic scale.
WIDE = 10.0


# Distributions of Optuna by hyper-parameter, as in `--set`.
Ranges = dict[str, Any]


def parse_range(text: str) -> tuple[str, Any]:
    """Read "n_epochs=1..10", "gae_lambda=0.8..1.0" or "batch_size=512|1024", whose choices are
    values as YAML.
    """
    error = ArgumentError(
        f"search={text}: expected name=low..high, low < high, or name=value|value"
    )
    name, _, values = text.partition("=")
    if not name or not values:
        raise error
    if "|" in values:
        choices = tuple(values.split("|"))
        if not all(choices) or len(set(choices)) != len(choices):
            raise error
        return name, CategoricalDistribution(choices)
    bounds = values.split("..")
    whole = all(re.fullmatch(r"[+-]?\d+", bound) for bound in bounds)
    try:
        low, high = map(int if whole else float, bounds)
    except ValueError:
        raise error from None
    if not -math.inf < low < high < math.inf:
        raise error
    kind: Any = IntDistribution if whole else FloatDistribution
    return name, kind(low, high, log=low > 0 and high / low >= WIDE)


def parse_ranges(texts: Sequence[str], algorithm: str) -> Ranges:
    """Read ranges, those of an algorithm if there are none."""
    given = texts or DEFAULT_RANGES.get(algorithm.removeprefix("recurrent_"), ())
    ranges = [parse_range(text) for text in given]
    if not ranges or len(dict(ranges)) != len(ranges):
        raise ArgumentError(f"search={texts}: expected ranges of different names")
    return dict(ranges)


def values_of(entry: Mapping[str, Any], ranges: Ranges) -> dict[str, Any]:
    """Return the values of a recipe that are in the ranges, for a trial of what it is now."""
    values = {}
    for name, one in ranges.items():
        value = entry.get(name)
        if isinstance(value, str) and value.startswith(LINEAR_DECAY):
            value = float(value.removeprefix(LINEAR_DECAY))
        if isinstance(one, FloatDistribution) and isinstance(value, int):
            value = float(value)
        if isinstance(one, CategoricalDistribution):
            known = value in one.choices
        else:
            known = isinstance(value, type(one.low)) and one.low <= value <= one.high
        if known:
            values[name] = value
    return values


def changes_of(values: Mapping[str, Any], entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the values of a trial as changes of a recipe, see `load_recipe`."""
    rate = entry.get("learning_rate")
    changes = []
    for name, value in values.items():
        text = str(value)
        if isinstance(value, float):
            rounded = float(f"{value:.{DIGITS}g}")
            # YAML reads 1e-05 as a text.
            text = np.format_float_positional(rounded, trim="0")
            if name == "learning_rate" and str(rate).startswith(LINEAR_DECAY):
                text = LINEAR_DECAY + text
        changes.append(f"{name}={text}")
    return tuple(changes)


# The agent of a trial is evaluated on the episodes of the learning curve.
EPISODES, FIRST_EPISODE = 200, 3_000_000_000


class Outcome(NamedTuple):
    """Result of a trial."""

    # Mean of recent segments or ticks in training, at up to `POINTS` equal parts of it.
    rewards: tuple[float, ...]
    # Of the agent afterwards; None if the training ended early.
    reward: float | None
    # Why it could not be trained.
    error: str = ""


class _EndedEarlyError(Exception):
    """The training is worse than half of the trials before it."""


def train_trial(search: "Search", changes: Sequence[str], medians: Sequence[float]) -> Outcome:
    """Train an agent with the changes of a trial, without a folder, and evaluate it.

    The training ends at a point at which its best reward so far is smaller than the median of
    earlier trials, if there are enough of them.
    """
    rewards: list[float] = []

    def check(now: Any) -> None:
        reached = min(POINTS, POINTS * now.steps // now.total)
        while len(rewards) < reached:
            rewards.append(now.reward)
            best = max((reward for reward in rewards if not math.isnan(reward)), default=math.inf)
            if (
                medians
                and FIRST_POINT <= len(rewards) < POINTS
                and best < medians[len(rewards) - 1]
            ):
                raise _EndedEarlyError

    try:
        agent = train(
            search.recipe_name,
            search.env_id,
            seed=search.seed,
            steps=search.steps,
            changes=changes,
            on_progress=check,
            **search.options,
        )
    except _EndedEarlyError:
        return Outcome(tuple(rewards), None)
    except ArgumentError as error:
        # Values that do not go together, or a training that has diverged.
        return Outcome(tuple(rewards), None, str(error))
    metrics = evaluate(
        agent,
        search.env_id,
        episodes=EPISODES,
        seed=FIRST_EPISODE,
        **search.options,
    )
    return Outcome(tuple(rewards), metrics["reward"].value)


JOURNAL, BEST = "trials.log", "best.yml"


@dataclass(frozen=True)
class Search:
    """Settings of a search."""

    env_id: str
    # Which override those of the id.
    options: dict[str, Any]
    # Or path of a YAML file.
    recipe_name: str
    # Hyper-parameters of the recipe to override.
    changes: tuple[str, ...]
    # What is searched.
    ranges: Ranges
    # Of the trainings and of the proposals.
    seed: int
    # Of a training; None uses those of the recipe.
    steps: int | None

    def changed(self, values: Mapping[str, Any]) -> tuple[str, ...]:
        """Return all changes of the recipe with the values of a trial; refuse them if they do not
        go together.
        """
        changes = self.changes + changes_of(values, self.entry())
        self.entry(changes)
        return changes

    def entry(self, changes: Sequence[str] | None = None) -> dict[str, Any]:
        """Return the plain values of the recipe, with some changes in place of those of the
        search.
        """
        used = self.changes if changes is None else changes
        values: dict[str, Any] = load_recipe(self.recipe_name, self.env_id, used).as_json()["entry"]
        return values

    def as_text(self) -> str:
        """Return all settings; equal texts mean equal searches."""
        ranges = {name: str(one) for name, one in self.ranges.items()}
        return json.dumps(vars(self) | {"recipe": self.entry(), "ranges": ranges}, sort_keys=True)


def open_study(search: Search, folder: Path) -> optuna.Study:
    """Create the study of a search in a folder, or open it to go on."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study = optuna.create_study(
            storage=JournalStorage(JournalFileBackend(str(folder / JOURNAL))),
            study_name="tune",
            direction="maximize",
            load_if_exists=True,
        )
    settings = study.user_attrs.get("search")
    if settings is None:
        study.set_user_attr("search", search.as_text())
        # What the recipe has now.
        study.enqueue_trial(values_of(search.entry(), search.ranges))
    elif settings != search.as_text():
        raise ArgumentError(f"out={folder}: expected the flags with which its search began")
    # Of a killed search.
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.system_attrs.get("fixed_params", {}) | trial.params)
    return study


def ended(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that were trained to their end, or ended early."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def run_trials(
    search: Search,
    study: optuna.Study,
    trials: int,
    jobs: int,
    on_done: Callable[[int], None],
) -> None:
    """Train until the study of a search has a number of trials; refuse values that cannot be."""
    while (left := trials - len(ended(study))) > 0:
        number = len(study.get_trials(deepcopy=False))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            study.sampler = optuna.samplers.TPESampler(
                seed=search.seed + number,
                constant_liar=True,
            )
        batch = [study.ask(search.ranges) for _ in range(min(left, TRIALS_AT_A_TIME))]
        outcomes = {}
        calls = {}
        medians = median_rewards(study)
        for trial in batch:
            try:
                changes = search.changed(trial.params)
                calls[trial.number] = joblib.delayed(train_trial)(search, changes, medians)
            except ArgumentError as error:
                outcomes[trial.number] = Outcome((), None, str(error))
        parallel = joblib.Parallel(n_jobs=jobs, return_as="generator")
        for trained, outcome in zip(calls, parallel(calls.values()), strict=True):
            outcomes[trained] = outcome
            on_done(trained)
        for trial in batch:
            outcome = outcomes[trial.number]
            for point, reward in enumerate(outcome.rewards):
                trial.report(reward, point)
            state = None
            if outcome.reward is None:
                state = TrialState.FAIL if outcome.error else TrialState.PRUNED
            study.tell(trial, outcome.reward, state)
        errors = [outcome.error for outcome in outcomes.values() if outcome.error]
        if len(errors) == len(batch):
            raise ArgumentError(f"no trial could be trained: {errors[-1]}")


def median_rewards(study: optuna.Study) -> tuple[float, ...]:
    """Return the median reward of trials that were trained to their end, at each point of a
    training.
    """
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    if len(trials) < FIRST_TRIALS:
        return ()
    curves = [trial.intermediate_values for trial in trials]
    return tuple(
        statistics.median(curve.get(point, float("-inf")) for curve in curves)
        for point in range(POINTS)
    )


def write_best(search: Search, study: optuna.Study, folder: Path) -> Path:
    """Write the recipe of the best trial, for `hybridtrack train --recipe`."""
    best = study.best_trial
    entry = search.entry(search.changed(best.params))
    short = search.env_id.rpartition(":")[2]
    text = f"# Trial {best.number} of {len(ended(study))}: reward {best.value:.3f} in the search.\n"
    text += yaml.safe_dump({short: json.loads(json.dumps(entry))}, sort_keys=False)
    (folder / BEST).write_text(text, encoding="utf-8")
    return folder / BEST


def best_rows(study: optuna.Study, count: int) -> Sequence[FrozenTrial]:
    """Return the trials with the largest rewards, the best first."""
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    return sorted(trials, key=lambda trial: (-(trial.value or 0.0), trial.number))[:count]
