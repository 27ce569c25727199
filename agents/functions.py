"""The commands as Python functions, for programs and notebooks: `load`, `evaluate`, `compare`
and `train`.

`env_id` is a registered id, and `options` are those of the environment, as in `gym.make`.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.progress import Progress

from agents.comparison.comparison import Comparison
from agents.comparison.plan import Plan
from agents.evaluation.registry import find_decider, load_decider
from agents.evaluation.task import sweep, task_of
from agents.interface.world_arguments import DEFAULT_ENV
from agents.training.algorithm import TrainingProgress
from agents.training.checkpoint import has_checkpoint
from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from baselines.rules.decider import Decider
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import check_integer, of_keywords, reject


def load(decider: Any, env_id: str = DEFAULT_ENV, **options: Any) -> Decider:
    """Return a decider by name: "ate:1e-6", "shipped", a run folder, "model.zip",
    "mine.py:Rule", or itself.

    Raises:
        ArgumentError: no decider of the environment has this name, or an option is not allowed. A
            decider with filters of its own, as "shipped", reads the row of every tick.
    """
    world = task_of(env_id, options).options
    loaded = load_decider(decider, world)
    if loaded.every_tick and world.decide_every > 1:
        allowed = f"1 for {decider!r}, which reads every tick"
        raise reject("decide_every", world.decide_every, allowed)
    return loaded


def evaluate(
    decider: Any, env_id: str = DEFAULT_ENV, *, episodes: int = 1000, seed: int = 0, **options: Any
) -> dict[str, Estimate]:
    """Return the metrics of a decider with their 95 % confidence intervals, as `hybridtrack
    evaluate`.

    Args:
        decider: a name, a function of the observations, or an object with `predict`, see `load`.
        env_id, options: of the environment.
        episodes: number of episodes.
        seed: of the first episode; later ones have consecutive seeds.

    Raises:
        ArgumentError: an argument is not allowed.
    """
    task = task_of(env_id, options)
    named = find_decider(decider, task.options)
    thresholds = (named.threshold,)
    check_integer("seed", seed, minimum=0)
    scores = sweep(task, named, check_integer("episodes", episodes), seed, thresholds=thresholds)
    return task.estimates(scores)


def compare(
    deciders: Sequence[Any] = (),
    env_id: str = DEFAULT_ENV,
    *,
    out: str | os.PathLike[str] | None = None,
    **options: Any,
) -> Comparison:
    """Train agents and score all deciders on the same episodes, as `hybridtrack compare`.

    Args:
        deciders: the reference first: rules and agents, see `load`, and recipes to train; by
            default the usual ones of the environment.
        env_id: of the environment.
        out: folder for the trained agents, from which an interrupted comparison goes on; None
            writes nothing.
        options: of the environment, and the other flags of `hybridtrack compare`: episodes, seed,
            selection_episodes, steps, training_seeds, curves, jobs.

    Raises:
        ArgumentError: an argument is not allowed.
    """
    given = {"deciders": tuple(deciders), "env": env_id, **options}
    plan = of_keywords(Plan, given).completed()
    return plan.compare(None if out is None else Path(out), Progress(disable=True))


def train(
    recipe: str = "ppo",
    env_id: str = DEFAULT_ENV,
    *,
    out: str | os.PathLike[str] | None = None,
    seed: int = 0,
    steps: int | None = None,
    changes: Sequence[str] = (),
    resume: bool = False,
    on_progress: Callable[[TrainingProgress], None] | None = None,
    **options: Any,
) -> Decider:
    """Train an agent, as `hybridtrack train`, and return it.

    Args:
        recipe: name of a recipe, or a YAML file.
        env_id, options: of the environment.
        out: run folder, new or empty; None writes nothing.
        resume: go on from the checkpoint in the run folder, if there is one.
        on_progress: called after each round with its progress, of which `steps` of `total` are done
            with the mean `reward` of recent segments or ticks; what it raises ends the training.
        seed: of weights, tracks and mini-batches.
        steps: environment steps, summed over tracks; None for those of the recipe.
        changes: hyper-parameters to override, each "name=value".

    Raises:
        ArgumentError: an argument is not allowed.
    """
    settings = load_recipe(recipe, env_id, changes, options.get("modes") is not None)
    folder = None if out is None else Path(out)
    begun = resume and folder is not None and has_checkpoint(folder)
    run = make_run(env_id, options, settings, seed, folder, steps, begun)
    run.train(on_progress)
    return run.agent(settings.name)
