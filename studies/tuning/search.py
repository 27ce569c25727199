"""The search: ranges of hyper-parameters; Optuna proposes trials, processes train them, and a
folder keeps them.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import optuna
import pandas as pd
import yaml
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from agents import evaluate, load_recipe, train
from hybrid_env import ArgumentError

# Points of a training at which its reward is compared.
POINTS = 20
# Ranges by algorithm; recurrent PPO has those of PPO. Others need ranges of their own.
DEFAULT_RANGES = {
    "ppo": (
        "learning_rate=0.0003..0.03",
        "n_epochs=1..10",
        "gae_lambda=0.8..0.99",
        "ent_coef=0.0..0.02",
    ),
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
}
# Distributions of Optuna by hyper-parameter, as in `--set`.
Ranges = dict[str, Any]


def parse_range(text: str) -> tuple[str, Any]:
    """Read "n_epochs=1..10", "gae_lambda=0.8..1.0" or "batch_size=512|1024", whose choices are
    values as YAML. A positive range of a factor of ten or more is logarithmic.
    """
    name, _, values = text.partition("=")
    try:
        if "|" in values:
            return name, CategoricalDistribution(values.split("|"))
        low, high = map(json.loads, values.split(".."))
        is_whole = isinstance(low, int) and isinstance(high, int)
        kind: Any = IntDistribution if is_whole else FloatDistribution
        return name, kind(low, high, log=low > 0 and high >= 10 * low)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"search={text}: expected name=low..high, low < high, or name=value|value"
        ) from None


def parse_ranges(texts: Sequence[str], algorithm: str) -> Ranges:
    """Read ranges, those of an algorithm if there are none."""
    given = texts or DEFAULT_RANGES.get(algorithm.removeprefix("recurrent_"), ())
    if not given:
        raise ArgumentError("search=: expected ranges of this algorithm")
    return dict(map(parse_range, given))


@dataclass(frozen=True)
class Search:
    """Settings of a search."""

    env_id: str
    # Or path of a YAML file.
    recipe_name: str
    # Hyper-parameters of the recipe to override.
    changes: tuple[str, ...]
    # What is searched.
    ranges: Ranges
    # Seed of the trainings and of the proposals.
    seed: int
    # Environment steps of a training; None uses those of the recipe.
    steps: int | None

    def entry(self, changes: Sequence[str]) -> dict[str, Any]:
        """Return the plain values of the recipe with some changes."""
        recipe = load_recipe(self.recipe_name, self.env_id, changes)
        return dict(recipe.as_json()["entry"])

    @property
    def decays(self) -> str:
        """Prefix of the learning rate if it decays linearly."""
        rate = str(self.entry(self.changes).get("learning_rate"))
        return "lin_" if rate.startswith("lin_") else ""

    def first_values(self) -> dict[str, Any]:
        """Return the values of the recipe that are in the ranges, for a trial of what it is now."""
        values: dict[str, Any] = {}
        entry = self.entry(self.changes)
        for name, law in self.ranges.items():
            text = str(entry.get(name)).removeprefix("lin_")
            with suppress(ValueError):
                if isinstance(law, CategoricalDistribution):
                    values[name] = law.choices[law.choices.index(text)]
                elif law.low <= float(text) <= law.high:
                    values[name] = type(law.low)(float(text))
        return values

    def changed(self, values: Mapping[str, Any]) -> tuple[str, ...]:
        """Return all changes of the recipe with the values of a trial, see `load_recipe`."""
        changes = []
        for name, value in values.items():
            text = str(value)
            if isinstance(value, float):
                # YAML reads 1e-05 as a text.
                text = np.format_float_positional(float(f"{value:.3g}"), trim="0")
                text = self.decays + text if name == "learning_rate" else text
            changes.append(f"{name}={text}")
        return *self.changes, *changes


# What a trial tells: mean rewards of recent segments or ticks in training, at up to `POINTS` equal
# parts of it; that of the agent afterwards, None if the training ended early; why it could not be
# trained.
Outcome = tuple[list[float], float | None, str]


def train_trial(search: Search, values: Mapping[str, Any], medians: Sequence[float]) -> Outcome:
    """Train an agent with the values of a trial, without a folder, and evaluate it.

    The training ends at a point at which its best reward so far is smaller than the median of
    earlier trials, if there are enough of them.
    """
    rewards: list[float] = []

    def check(now: Any) -> None:
        reached = min(POINTS, POINTS * now.steps // now.total)
        while len(rewards) < reached:
            rewards.append(now.reward)
            # NaN is smaller than nothing.
            best = np.fmax.reduce(rewards)
            if medians and 5 <= len(rewards) < POINTS and best < medians[len(rewards) - 1]:
                raise optuna.TrialPruned

    reward, error = None, ""
    try:
        agent = train(
            search.recipe_name,
            search.env_id,
            seed=search.seed,
            steps=search.steps,
            changes=search.changed(values),
            on_progress=check,
        )
        # On the episodes of the learning curve.
        metrics = evaluate(agent, search.env_id, episodes=200, seed=3_000_000_000)
        reward = metrics["reward"].value
    except optuna.TrialPruned:
        pass
    except ArgumentError as refusal:
        # Values that do not go together, or a training that has diverged.
        error = str(refusal)
    return rewards, reward, error


def open_study(search: Search, folder: Path) -> optuna.Study:
    """Create the study of a search in a folder, or open it to go on."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)
    study = optuna.create_study(
        storage=JournalStorage(JournalFileBackend(str(folder / "trials.log"))),
        study_name="tune",
        direction="maximize",
        load_if_exists=True,
    )
    settings = study.user_attrs.get("search")
    if settings is None:
        study.set_user_attr("search", repr(search))
        # What the recipe has now.
        study.enqueue_trial(search.first_values())
    elif settings != repr(search):
        raise ArgumentError(f"out={folder}: expected the flags with which its search began")
    # A killed search leaves trials that run.
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.system_attrs.get("fixed_params", {}) | trial.params)
    return study


def ended(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that were trained to their end, or ended early."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def run_trials(search: Search, study: optuna.Study, trials: int, jobs: int) -> None:
    """Train until the study of a search has a number of trials; refuse values that cannot be."""
    while (left := trials - len(ended(study))) > 0:
        number = len(study.get_trials(deepcopy=False))
        study.sampler = optuna.samplers.TPESampler(seed=search.seed + number, constant_liar=True)
        # Independent of the number of jobs, so that results are, too.
        batch = [study.ask(search.ranges) for _ in range(min(left, 4))]
        medians = median_rewards(study)
        outcomes = joblib.Parallel(n_jobs=jobs)(
            joblib.delayed(train_trial)(search, trial.params, medians) for trial in batch
        )
        for trial, (rewards, reward, error) in zip(batch, outcomes, strict=True):
            for point, of_point in enumerate(rewards):
                trial.report(of_point, point)
            ended_early = TrialState.FAIL if error else TrialState.PRUNED
            study.tell(trial, reward, ended_early if reward is None else None)
        errors = [error for *_, error in outcomes if error]
        if len(errors) == len(batch):
            raise ArgumentError(f"no trial could be trained: {errors[-1]}")


def median_rewards(study: optuna.Study) -> tuple[float, ...]:
    """Return the median reward of trials that were trained to their end, at each point of a
    training.
    """
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    # So many are all trained to their end, before others may end early.
    if len(trials) < 5:
        return ()
    curves = pd.DataFrame([trial.intermediate_values for trial in trials])
    return tuple(curves.reindex(columns=range(POINTS)).fillna(-np.inf).median())


def write_best(search: Search, study: optuna.Study, folder: Path) -> Path:
    """Write the recipe of the best trial, for `hybridtrack train --recipe`."""
    best = study.best_trial
    entry = search.entry(search.changed(best.params))
    short = search.env_id.rpartition(":")[2]
    text = f"# Trial {best.number} of {len(ended(study))}: reward {best.value:.3f} in the search.\n"
    text += yaml.safe_dump({short: json.loads(json.dumps(entry))}, sort_keys=False)
    path = folder / "best.yml"
    path.write_text(text, encoding="utf-8")
    return path
