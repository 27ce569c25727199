"""Training runs of any algorithm: a new one from a recipe, or one that goes on from its folder."""

from pathlib import Path
from typing import Any

from agents.training import run_folder
from agents.training.ppo import PPORun
from agents.training.recipe import Recipe, recipe_of
from agents.training.run import Run
from agents.training.sequence import SequenceRun
from hybrid_env.checks import check_integer, reject


def make_run(
    env_id: str,
    options: dict[str, Any],
    recipe: Recipe,
    seed: int = 0,
    folder: Path | None = None,
    steps: int | None = None,
    resume: bool = False,
) -> Run:
    """A run of the algorithm of a recipe.

    Args:
        env_id: registered id of the environment.
        options: of the world, over those of the id.
        seed: of weights, tracks and mini-batches, below 2^31; the same seed gives the same weights.
        folder: run folder, made if it is not there; None keeps nothing.
        steps: environment steps, summed over tracks; None takes the recipe's.
        resume: go on from the checkpoint in the folder.
    """
    check_integer("seed", seed, minimum=0)
    if seed >= 2**31:
        raise reject("seed", seed, "an integer below 2^31")
    steps = recipe.n_timesteps if steps is None else check_integer("steps", steps)
    kind = SequenceRun if recipe.algo == "sequence" else PPORun
    return kind(env_id, options, recipe, seed, folder, steps, resume)


def resume_run(folder: Path, steps: int | None = None) -> Run:
    """Go on with a run from its last checkpoint, to its own number of steps or to another.

    Raises:
        ArgumentError: the folder holds no run, or a damaged one.
    """
    config = run_folder.read_config(folder)
    try:
        recipe = recipe_of(config["recipe"]["name"], config["recipe"]["entry"])
        steps = int(config["steps"]) if steps is None else check_integer("steps", steps)
        env_id, options, seed = str(config["env"]), dict(config["options"]), int(config["seed"])
    except (KeyError, TypeError, ValueError) as error:
        allowed = f"a run folder with a readable {run_folder.CONFIG} ({error})"
        raise reject("resume", str(folder), allowed) from None
    return make_run(env_id, options, recipe, seed, folder, steps, resume=True)
