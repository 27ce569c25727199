"""The search: ranges of hyper-parameters; Optuna proposes trials, workers train them, and a
folder keeps them.
"""

import functools
import json
import math
import re
import statistics
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import optuna
import yaml
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from agents.interface.input_files import parse_yaml
from agents.interface.output_files import atomic_file
from agents.interface.parallel import Call, Workers
from agents.training.algorithm import TrainingProgress
from agents.training.learning_curve import REWARD_KEY
from agents.training.recipe import Recipe, load_recipe
from agents.training.runs import make_run
from hybrid_env.checks import ArgumentError, check_number, reject

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
    **dict.fromkeys(("reward", "tandem", "distilled", "transformer"), (RATE, "hidden=16..128")),
    **dict.fromkeys(
        ("kalman", "statements", "rhythm", "jump_markov", "flights", "gliders"),
        (RATE, "hidden=8..64"),
    ),
}
"""Ranges by algorithm; recurrent PPO has those of PPO."""

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
    error = reject("search", text, "name=low..high with numbers, low < high, or name=value|value")
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


def parse_ranges(texts: Sequence[str], recipe: Recipe) -> Ranges:
    """Read ranges, those of the algorithm of a recipe if there are none."""
    ranges = list(map(parse_range, texts or DEFAULT_RANGES[recipe.algo.removeprefix("recurrent_")]))
    if len(dict(ranges)) != len(ranges):
        raise reject("search", texts, "different names")
    return dict(ranges)


def values_of(recipe: Recipe, ranges: Ranges) -> dict[str, Any]:
    """Return the values of a recipe that are in the ranges, for a trial of what it is now."""
    entry = recipe.as_json()["entry"]
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


def changes_of(values: Mapping[str, Any], recipe: Recipe) -> tuple[str, ...]:
    """Return the values of a trial as changes of a recipe, see `recipe.load_recipe`."""
    rate = recipe.as_json()["entry"].get("learning_rate")
    changes = []
    for name, value in values.items():
        text = str(value)
        if isinstance(value, float):
            rounded = float(f"{value:.{DIGITS}g}")
            # YAML reads 1e-05 as a text.
            text = np.format_float_positional(rounded, trim="0")
            if name == "learning_rate" and str(rate).startswith(LINEAR_DECAY):
                text = LINEAR_DECAY + text
        else:
            parse_yaml(text)
        changes.append(f"{name}={text}")
    return tuple(changes)


class Outcome(NamedTuple):
    """Result of a trial."""

    # Mean of recent segments or ticks in training, at up to `POINTS` equal parts of it.
    rewards: tuple[float, ...]
    # Of the agent on the episodes of the learning curve; None if the training ended early.
    reward: float | None
    # Why it could not be trained.
    error: str = ""


class _EndedEarlyError(Exception):
    """The training is worse than half of the trials before it."""


def train_trial(search: "Search", recipe: Recipe, medians: Sequence[float]) -> Outcome:
    """Train an agent with the recipe of a trial, without a folder, and evaluate it.

    The training ends at a point at which its best reward so far is smaller than the median of
    earlier trials, if there are enough of them.
    """
    rewards: list[float] = []

    def check(now: TrainingProgress) -> None:
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
        run = make_run(search.env_id, search.options, recipe, search.seed, steps=search.steps)
        run.train(check)
    except _EndedEarlyError:
        return Outcome(tuple(rewards), None)
    except ArgumentError as error:
        # Values that do not go together, or a training that has diverged.
        return Outcome(tuple(rewards), None, str(error))
    found = run.curve.evaluate(run.family(""), run.num_timesteps, 0.0)
    return Outcome(tuple(rewards), float(found[REWARD_KEY]))


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

    def recipe(self, values: dict[str, Any] | None = None) -> Recipe:
        """Return the recipe, with the values of a trial if they are given."""
        base = load_recipe(self.recipe_name, self.env_id, self.changes)
        if not values:
            return base
        return load_recipe(self.recipe_name, self.env_id, self.changes + changes_of(values, base))

    def as_text(self) -> str:
        """Return all settings; equal texts mean equal searches."""
        ranges = {name: str(one) for name, one in self.ranges.items()}
        return json.dumps(
            vars(self) | {"recipe": self.recipe().as_json(), "ranges": ranges},
            sort_keys=True,
        )


def open_study(search: Search, folder: Path) -> optuna.Study:
    """Create the study of a search in a folder, or open it to go on."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        try:
            _cut_last_line(folder / JOURNAL)
            storage = JournalStorage(JournalFileBackend(str(folder / JOURNAL)))
            study = optuna.create_study(
                storage=storage,
                study_name="tune",
                direction="maximize",
                load_if_exists=True,
            )
            for trial in ended(study):
                sum(trial.intermediate_values.values(), check_number("value", trial.value or 0.0))
        except Exception as error:
            # Optuna reads any content without checks.
            raise reject(
                "out",
                str(folder),
                f"a folder with a readable {JOURNAL} ({error})",
            ) from None
    settings = study.user_attrs.get("search")
    if settings is None:
        study.set_user_attr("search", search.as_text())
        # What the recipe has now.
        study.enqueue_trial(values_of(search.recipe(), search.ranges))
    elif settings != search.as_text():
        raise reject("out", str(folder), "a new folder, or the flags with which its search began")
    # Of a killed search.
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.system_attrs.get("fixed_params", {}) | trial.params)
    return study


def _cut_last_line(journal: Path) -> None:
    """Remove the last line of a journal if it has no end, because the process was killed while
    it wrote.
    """
    content = journal.read_bytes() if journal.is_file() else b""
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        with atomic_file(journal) as part:
            part.write_bytes(whole)


def ended(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that were trained to their end, or ended early."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def run_trials(
    search: Search,
    study: optuna.Study,
    trials: int,
    workers: Workers,
    on_done: Callable[[str], None],
) -> None:
    """Train with the workers until the study of a search has a number of trials; refuse values
    that cannot be.
    """
    while (left := trials - len(ended(study))) > 0:
        number = len(study.get_trials(deepcopy=False))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            study.sampler = optuna.samplers.TPESampler(
                seed=search.seed + number,
                constant_liar=True,
            )
        batch = [study.ask(search.ranges) for _ in range(min(left, TRIALS_AT_A_TIME))]
        asked = {trial.number: trial for trial in batch}
        calls: dict[int, Call] = {}
        failed = {}
        medians = median_rewards(study)
        for one, trial in asked.items():
            try:
                calls[one] = functools.partial(
                    train_trial,
                    search,
                    search.recipe(trial.params),
                    medians,
                )
            except ArgumentError as error:
                failed[one] = Outcome((), None, str(error))
        outcomes = failed | dict(workers.results(calls, lambda one: on_done(f"trial {one}")))
        for one, trial in asked.items():
            found = outcomes[one]
            for point, reward in enumerate(found.rewards):
                trial.report(reward, point)
            early = (
                None
                if found.reward is not None
                else TrialState.FAIL
                if found.error
                else TrialState.PRUNED
            )
            study.tell(trial, found.reward, early)
        errors = [outcome.error for outcome in outcomes.values() if outcome.error]
        if len(errors) == len(asked):
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
    entry = search.recipe(best.params).as_json()["entry"]
    short = search.env_id.rpartition(":")[2]
    text = f"# Trial {best.number} of {len(ended(study))}: reward {best.value:.3f} in the search.\n"
    text += yaml.safe_dump({short: json.loads(json.dumps(entry))}, sort_keys=False)
    with atomic_file(folder / BEST) as part:
        part.write_text(text, encoding="utf-8")
    return folder / BEST


def best_rows(study: optuna.Study, count: int) -> Sequence[FrozenTrial]:
    """Return the trials with the largest rewards, the best first."""
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    return sorted(trials, key=lambda trial: (-(trial.value or 0.0), trial.number))[:count]
