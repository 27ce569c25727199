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
    """An algorithm with `WorldsSettings`."""

    settings: Any
    world: WorldOptions

    def prepare(self) -> None:
        """Set the options of the environments; refuse those in which hypotheses are not
        declared.
        """
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._fixed: list[tuple[WorldOptions, int]] = []
        for training_world in self.settings.worlds:
            options = self.options | dict(training_world.options)
            env = make_vector_env(training_world.env or self.env_id, 1, **options)
            self._fixed.append((env.options, training_world.n_envs))
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
            worlds += [
                (WorldOptions.of(**draw_world(generator, drawn.radii)), drawn.n_envs)
                for _ in range(drawn.worlds)
            ]
        return worlds
