"""The search: Optuna proposes trials, workers train them, and a folder keeps them."""

import functools
import json
import math
import statistics
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import optuna
import yaml
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from agents.interface.output_files import atomic_file
from agents.interface.parallel import Call, Workers
from agents.training.learning_curve import REWARD_KEY
from agents.training.recipe import Recipe, load_recipe
from agents.training.run import TrainingProgress
from agents.training.runs import make_run
from agents.tuning.ranges import Range, changes_of, values_of
from hybrid_env.checks import ArgumentError, check_number, reject

POINTS = 20  # of the reward during a training
FIRST_POINT = 5  # points before a training may end
TRIALS_AT_A_TIME = 4  # that Optuna proposes; independent of the number of jobs, so that results are, too
FIRST_TRIALS = 5  # that are all trained to their end, before others may end early


class Outcome(NamedTuple):
    """Result of a trial."""

    rewards: tuple[float, ...]  # mean of recent segments or ticks in training, at up to `POINTS` equal parts of it
    reward: float | None  # of the agent on the episodes of the learning curve; None if the training ended early
    error: str = ""  # why it could not be trained


class _EndedEarlyError(Exception):
    """The training is worse than half of the trials before it."""


def train_trial(search: "Search", recipe: Recipe, medians: Sequence[float]) -> Outcome:
    """Train an agent with the recipe of a trial, without a folder, and evaluate it.

    The training ends at a point at which its best reward so far is smaller than the median of earlier trials, if there
    are enough of them.
    """
    rewards: list[float] = []

    def check(now: TrainingProgress) -> None:
        reached = min(POINTS, POINTS * now.steps // now.total)
        while len(rewards) < reached:
            rewards.append(now.reward)
            best = max((reward for reward in rewards if not math.isnan(reward)), default=math.inf)
            if medians and FIRST_POINT <= len(rewards) < POINTS and best < medians[len(rewards) - 1]:
                raise _EndedEarlyError

    try:
        run = make_run(search.env_id, search.options, recipe, search.seed, steps=search.steps)
        run.train(check)
    except _EndedEarlyError:
        return Outcome(tuple(rewards), None)
    except ArgumentError as error:  # values that do not go together, or a training that has diverged
        return Outcome(tuple(rewards), None, str(error))
    found = run.curve.evaluate(run.family(""), run.num_timesteps, 0.0)
    return Outcome(tuple(rewards), float(found[REWARD_KEY]))


JOURNAL, BEST = "trials.log", "best.yml"


@dataclass(frozen=True)
class Search:
    """Settings of a search."""

    env_id: str
    options: dict[str, Any]  # which override those of the id
    recipe_name: str  # or path of a YAML file
    changes: tuple[str, ...]  # hyper-parameters of the recipe to override
    ranges: tuple[Range, ...]  # what is searched
    seed: int  # of the trainings and of the proposals
    steps: int | None  # of a training; None uses those of the recipe

    def recipe(self, values: dict[str, Any] | None = None) -> Recipe:
        """Return the recipe, with the values of a trial if they are given."""
        base = load_recipe(self.recipe_name, self.env_id, self.changes)
        if not values:
            return base
        return load_recipe(self.recipe_name, self.env_id, self.changes + changes_of(values, base))

    def as_text(self) -> str:
        """Return all settings; equal texts mean equal searches."""
        return json.dumps(asdict(self) | {"recipe": self.recipe().as_json()}, sort_keys=True)


def open_study(search: Search, folder: Path) -> optuna.Study:
    """Create the study of a search in a folder, or open it to go on."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        try:
            _cut_last_line(folder / JOURNAL)
            storage = JournalStorage(JournalFileBackend(str(folder / JOURNAL)))
            study = optuna.create_study(storage=storage, study_name="tune", direction="maximize", load_if_exists=True)
            for trial in ended(study):
                sum(trial.intermediate_values.values(), check_number("value", trial.value or 0.0))
        except Exception as error:  # Optuna reads any content without checks
            raise reject("out", str(folder), f"a folder with a readable {JOURNAL} ({error})") from None
    settings = study.user_attrs.get("search")
    if settings is None:
        study.set_user_attr("search", search.as_text())
        study.enqueue_trial(values_of(search.recipe(), search.ranges))  # what the recipe has now
    elif settings != search.as_text():
        raise reject("out", str(folder), "a new folder, or the flags with which its search began")
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):  # of a killed search
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.system_attrs.get("fixed_params", {}) | trial.params)
    return study


def _cut_last_line(journal: Path) -> None:
    """Remove the last line of a journal if it has no end, because the process was killed while it wrote."""
    content = journal.read_bytes() if journal.is_file() else b""
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        with atomic_file(journal) as part:
            part.write_bytes(whole)


def ended(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that were trained to their end, or ended early."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def run_trials(
    search: Search, study: optuna.Study, trials: int, workers: Workers, on_done: Callable[[str], None]
) -> None:
    """Train with the workers until the study of a search has a number of trials.

    Raises:
        ArgumentError: no combination of values can be trained.
    """
    while (left := trials - len(ended(study))) > 0:
        number = len(study.get_trials(deepcopy=False))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            study.sampler = optuna.samplers.TPESampler(seed=search.seed + number, constant_liar=True)
        asked = {trial.number: trial for trial in (study.ask() for _ in range(min(left, TRIALS_AT_A_TIME)))}
        calls: dict[int, Call] = {}
        failed = {}
        medians = median_rewards(study)
        for one, trial in asked.items():
            for searched in search.ranges:
                searched.suggest(trial)
            try:
                calls[one] = functools.partial(train_trial, search, search.recipe(trial.params), medians)
            except ArgumentError as error:
                failed[one] = Outcome((), None, str(error))
        outcomes = failed | dict(workers.results(calls, lambda one: on_done(f"trial {one}")))
        for one, trial in asked.items():
            found = outcomes[one]
            for point, reward in enumerate(found.rewards):
                trial.report(reward, point)
            early = None if found.reward is not None else TrialState.FAIL if found.error else TrialState.PRUNED
            study.tell(trial, found.reward, early)
        errors = [outcome.error for outcome in outcomes.values() if outcome.error]
        if len(errors) == len(asked):
            raise ArgumentError(f"no trial could be trained: {errors[-1]}")


def median_rewards(study: optuna.Study) -> tuple[float, ...]:
    """Return the median reward of trials that were trained to their end, at each point of a training."""
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    if len(trials) < FIRST_TRIALS:
        return ()
    curves = [trial.intermediate_values for trial in trials]
    return tuple(statistics.median(curve.get(point, float("-inf")) for curve in curves) for point in range(POINTS))


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
