"""The plan of a comparison: its deciders, thresholds and episodes."""

from dataclasses import dataclass
from typing import Any

from agents.evaluation.registry import SHIPPED, find_family, is_brought, is_own
from agents.evaluation.task import Task
from baselines.rules.decider import DeciderFamily, rules
from hybrid_env.checks import reject


@dataclass(frozen=True)
class Plan:
    """Settings of a comparison.

    Attributes:
        task: what is decided, in which environment.
        deciders: names of classical rules; the first is the reference.
        agents: recipes to train, 'shipped', or run folders.
        episodes: number of episodes that all figures are reported on.
        seed: of the first of them.
        selection_episodes: number of separate episodes for the selection of thresholds.
        steps: environment steps of each training; None takes the number in the recipe.
        training_seeds: number of agents trained per recipe.
        accuracy: of the thresholds that reach this accuracy, the one with the shortest mean decision time is
            selected; None selects the threshold with the largest mean reward.
        curves: False scores all deciders but the reference at their selected threshold only.
    """

    task: Task
    deciders: tuple[str, ...]
    agents: tuple[str, ...]
    episodes: int
    seed: int
    selection_episodes: int
    steps: int | None = None
    training_seeds: int = 1
    accuracy: float | None = None
    curves: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all deciders."""
        return (*self.deciders, *self.agents)

    @property
    def settings(self) -> dict[str, Any]:
        """Plain values of the settings."""
        others = {name: value for name, value in vars(self).items() if name != "task"}
        return {"env_id": self.task.env_id, "options": dict(self.task.given)} | others

    def family(self, name: str) -> Any:
        """Return the family of a decider, or the recipe of an agent still to be trained.

        Raises:
            ArgumentError: the name or an option is unknown, or a policy is for another number of hypotheses.
        """
        from agents.training.recipe import load_recipe, recipe_names

        if name in self.agents:
            recipes = recipe_names()
            if name in recipes or str(name).endswith(".yml"):
                return load_recipe(name, self.task.env_id)
            if name != SHIPPED and not is_brought(name):
                kinds = "'shipped', a run folder, model.zip, policy.onnx, a recipe as YAML"
                raise reject("agents", name, f"{kinds}, or {', '.join(recipes)}")
        elif name not in rules(self.task.switches) and not is_own(name):
            allowed = f"{', '.join(rules(self.task.switches))}, or mine.py:MyRule"
            raise reject("deciders", name, allowed)
        return find_family(name, self.task.options)

    def check(self) -> None:
        """Raise `ArgumentError` for a name that is unknown, or too many episodes."""
        self.task.check_episodes("episodes", self.episodes)
        self.task.check_episodes("selection-episodes", self.selection_episodes)
        for name in self.names:
            self.family(name)

    def calls(self) -> list[tuple[str, int]]:
        """Return name and training seed of everything that is scored."""
        found = []
        for name in self.names:
            trained = not isinstance(self.family(name), DeciderFamily)
            found += [(name, number) for number in range(self.training_seeds if trained else 1)]
        return found
