"""Base class of the algorithms that train in several environments: those of the recipe, and
random ones.
"""

from typing import Any

import numpy as np

from agents.evaluation.worlds import draw_world
from agents.training.algorithm import NetworkAlgorithm
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env


class WorldsAlgorithm(NetworkAlgorithm):
    """An algorithm with `WorldsSettings`; its `build` calls `create_worlds`."""

    settings: Any
    world: WorldOptions

    def create_worlds(self) -> None:
        """Set the options of the environments; refuse those in which hypotheses are not
        declared.
        """
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._fixed: list[tuple[WorldOptions, int]] = []
        for one in self.settings.worlds:
            options = self.options | dict(one.options)
            self._fixed.append(
                (make_vector_env(one.env or self.env_id, 1, **options).options, one.n_envs)
            )
        for world in (self.world, *(world for world, _ in self._fixed)):
            if world.actions != "all":
                raise reject(
                    "actions",
                    world.actions,
                    "'all' for an agent that declares hypotheses",
                )

    def all_worlds(self, generator: np.random.Generator) -> list[tuple[WorldOptions, int]]:
        """Return the environments of the recipe and new random ones, each with its number of
        tracks.
        """
        worlds = list(self._fixed)
        for drawn in self.settings.drawn_worlds:
            options = [draw_world(generator, drawn.radii) for _ in range(drawn.worlds)]
            worlds += [(WorldOptions.of(**one), drawn.n_envs) for one in options]
        return worlds
