"""What every training has in common: a run that is made from a recipe or goes on, and how it stands."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from agents import run_folder
from agents.deciders import DeciderFamily
from agents.recipe import Recipe, recipe_of
from hybrid_env.checks import check_integer, reject


@dataclass(frozen=True)
class TrainingProgress:
    """Where a training run stands.

    Attributes:
        steps, total: environment steps, done and wanted.
        reward: mean of a segment lately; NaN before the first has ended.
        ticks: mean decision time of a segment lately, likewise.
    """

    steps: int
    total: int
    reward: float
    ticks: float

    @property
    def note(self) -> str:
        """For a progress display."""
        return "" if math.isnan(self.reward) else f"reward {self.reward:+.3f}, {self.ticks:.1f} ticks"


class Run(Protocol):
    """One training, of any algorithm.

    Attributes:
        steps: environment steps wanted.
        seconds: of training so far, measurements apart.
    """

    steps: int
    seconds: float

    @property
    def done(self) -> int:
        """Environment steps made."""
        raise NotImplementedError

    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train to the end, saving the run every so many seconds."""

    def family(self, name: str) -> DeciderFamily:
        """The agent as it stands, as a decider."""
        raise NotImplementedError


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
    if recipe.algo == "sequence":
        from agents.sequence_training import SequenceRun

        return SequenceRun(env_id, options, recipe, seed, folder, steps, resume)
    from agents.ppo_training import PPORun

    return PPORun(env_id, options, recipe, seed, folder, steps, resume)


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
