"""Settings of a comparison, and the deciders that they name."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.evaluation.deciders import CLASSICAL_NAMES, SHIPPED, DeciderFamily, check_family, decider_family
from agents.training.recipe import Recipe, load_recipe, recipe_names
from baselines.rules import seeds
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env


@dataclass(frozen=True)
class Plan:
    """Settings of a comparison.

    Attributes:
        env_id: registered id of the environment.
        options: keyword arguments of the environment, which override those of the id.
        deciders: names of classical rules; the first is the reference.
        agents: recipes to train, 'shipped', or run folders.
        episodes: number of episodes that all figures are reported on.
        seed: of the first of them.
        steps: environment steps of each training; None takes the number in the recipe.
        training_seeds: number of agents trained per recipe.
        accuracy: of the thresholds that reach this accuracy, the one with the shortest mean decision time is
            selected; None selects the threshold with the largest mean reward.
        curves: False evaluates all deciders but the reference at their selected threshold only.
        selection_episodes: number of separate episodes for the selection of thresholds.
    """

    env_id: str
    options: dict[str, Any]
    deciders: tuple[str, ...]
    agents: tuple[str, ...]
    episodes: int
    seed: int
    steps: int | None
    training_seeds: int
    accuracy: float | None = None
    curves: bool = True
    selection_episodes: int = seeds.SELECTION_EPISODES

    def world(self) -> WorldOptions:
        """All options of the environment, including the defaults of the id."""
        return make_vector_env(self.env_id, 1, **self.options).options

    def families(self) -> list[DeciderFamily | Recipe]:
        """The deciders to compare: families, and recipes of agents still to be trained.

        Raises:
            ArgumentError: a name or an option is unknown, or a policy was trained for a different number of
                hypotheses.
        """
        world = self.world()
        found: list[DeciderFamily | Recipe] = []
        for name in self.deciders:
            if name not in CLASSICAL_NAMES:
                raise reject("deciders", name, ", ".join(CLASSICAL_NAMES))
            found.append(decider_family(name, world))
        for name in self.agents:
            if name in recipe_names() or name.endswith(".yml"):
                found.append(load_recipe(name, self.env_id))
                continue
            if name != SHIPPED and not Path(name).is_dir():
                allowed = f"'shipped', a run folder, a recipe as YAML, or one of {', '.join(recipe_names())}"
                raise reject("agents", name, allowed)
            family = decider_family(name, world)
            check_family(family, name, world)
            found.append(family)
        return found
