"""Creates training runs of any algorithm, new from a recipe or resumed from a run folder."""

from pathlib import Path
from typing import Any

from agents.learned.algorithm_names import find_algorithm
from agents.training import run_folder
from agents.training.algorithm import Algorithm
from agents.training.checkpoint import has_checkpoint
from agents.training.recipe import Recipe, recipe_of
from hybrid_env.checks import check_integer, reject
from hybrid_env.json_files import read_json


def make_run(
    env_id: str,
    options: dict[str, Any],
    recipe: Recipe,
    seed: int = 0,
    folder: Path | None = None,
    steps: int | None = None,
    resume: bool = False,
) -> Algorithm:
    """Create a run with the algorithm of a recipe.

    Args:
        env_id: registered id of the environment.
        options: environment options that override those of the id.
        recipe: algorithm and hyper-parameters.
        seed: of weights, tracks and mini-batches, below 2^31; training is reproducible for a given
            seed.
        folder: run folder, created if missing; None writes nothing.
        steps: environment steps, summed over tracks; None uses those of the recipe.
        resume: start from the checkpoint in the folder.
    """
    check_integer("seed", seed, minimum=0, maximum=2**31 - 1)
    steps = recipe.n_timesteps if steps is None else check_integer("steps", steps)
    kind: type[Algorithm] = find_algorithm(recipe.algo)
    return kind(env_id, options, recipe, seed, folder, steps, resume)


def resume_run(folder: Path, steps: int | None = None) -> Algorithm:
    """Resume a run from its last checkpoint; a run killed before its first one starts anew.

    `steps` is the total number of environment steps; None uses that of the run.
    """
    try:
        config = read_json(folder / run_folder.CONFIG)
        recipe = recipe_of(config["recipe"]["name"], config["recipe"]["entry"])
        steps = int(config["steps"]) if steps is None else check_integer("steps", steps)
        env_id = str(config["env"])
        options = dict(config["options"])
        seed = int(config["seed"])
    except (OSError, LookupError, TypeError, ValueError, OverflowError) as error:
        allowed = f"a run folder with a readable {run_folder.CONFIG} ({error})"
        raise reject("resume", str(folder), allowed) from None
    resume = has_checkpoint(folder)
    if not resume and not run_folder.is_free(folder):
        raise reject("resume", str(folder), "a run folder with a checkpoint")
    return make_run(env_id, options, recipe, seed, folder, steps, resume)
