"""Training of the anchor agent: likelihood of the anchor errors, and squared error of the next losses.

The agent itself decides during training, on the tracks of `anchor_stream`. Besides fixed worlds there are random
ones, which are drawn anew regularly. After every rollout the networks are trained on random samples of the last
anchors and declarations.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from torch import Tensor, nn

from agents.evaluation.worlds import draw_world
from agents.learned.anchor_decider import AnchorDecider, AnchorNetworks
from agents.learned.anchor_net import regret_inputs
from agents.training.anchor_stream import DECLARATION, AnchorStream, SampleBuffer
from agents.training.checkpoint import check_tracks, restore_generator
from agents.training.run import OwnNetworkRun, Round
from agents.training.settings import AnchorSettings
from baselines.rules import seeds
from hybrid_env.checks import check_integer, reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.vector_env import HybridTrackVectorEnv

LOG_EVERY = 10  # updates
RECENT_STEPS = 200  # environment steps with decisions that the displayed means are taken over
LARGEST_GRADIENT = 1.0  # norm of the gradient of each network


class AnchorRun(OwnNetworkRun):
    """A training run of the anchor agent; see `agents.training.runs.make_run` for the arguments."""

    smallest_factor: ClassVar[float] = 0.02
    decider = AnchorDecider

    def build(self) -> None:
        """Create networks, optimizer and environments."""
        assert isinstance(self.recipe.settings, AnchorSettings)
        self.settings = self.recipe.settings
        torch.manual_seed(self.seed)
        self.net = AnchorNetworks(self.settings.hidden)
        self.start(self.net, self.settings.learning_rate)
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._fixed = []
        for one in self.settings.worlds:
            options = self.options | dict(one.options)
            self._fixed.append((make_vector_env(one.env or self.env_id, 1, **options).options, one.n_envs))
        for world in (self.world, *(world for world, _ in self._fixed)):
            if world.actions != "all":
                raise reject("actions", world.actions, "'all' for an agent that declares hypotheses")
        self._generator = np.random.default_rng(seeds.TRAINING + self.seed)
        self._anchors = SampleBuffer(self.settings.buffer_size, self.net.anchor.inputs + 4)
        self._declarations = SampleBuffer(self.settings.buffer_size, DECLARATION + 1)
        self._generation = 0
        self._streams = self._draw_streams()
        self._round_steps = self.settings.n_steps * sum(stream.tracks for stream in self._streams)
        self._recent: list[tuple[float, float]] = []

    def set_steps(self, steps: int) -> None:
        """See `Run.set_steps`; draws new random worlds when a new generation of them begins."""
        super().set_steps(steps)
        generation = self._updates // self.settings.updates_per_world
        if self.settings.drawn_worlds and generation != self._generation:
            self._generation = generation
            self._streams = self._draw_streams()

    @property
    def _updates(self) -> int:
        return self.num_timesteps // self._round_steps

    def _draw_streams(self) -> list[AnchorStream]:
        """Return tracks of the fixed worlds and of random ones, one stream for each number of hypotheses."""
        first = seeds.TRAINING + self.seed * 10**9 + self._generation * 10**5
        generator = np.random.default_rng(first)
        worlds = list(self._fixed)
        for drawn in self.settings.drawn_worlds:
            options = [draw_world(generator, drawn.radii) for _ in range(drawn.worlds)]
            worlds += [(WorldOptions.of(**one), drawn.n_envs) for one in options]
        groups: dict[int, list[HybridTrackVectorEnv]] = {}
        for world, count in worlds:
            rows = world.longest_segment + 1  # a segment decided at once, and the first tick of the next
            env = HybridTrackVectorEnv(count, AutoresetMode.SAME_STEP, False, rows, **vars(world))
            groups.setdefault(world.hypotheses, []).append(env)
        return [AnchorStream(group, first + k * 10**4) for k, group in enumerate(groups.values())]

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Run.track_tensors`."""
        arrays = {"anchors": self._anchors.rows, "declarations": self._declarations.rows}
        for k, stream in enumerate(self._streams):
            arrays |= {f"{k}.{name}": array for name, array in stream.state_arrays().items()}
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def values(self) -> dict[str, Any]:
        """See `Run.values`."""
        return {
            "generators": [one.bit_generator.state for one in self._generators()],
            "counts": [self._anchors.count, self._declarations.count],
        }

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Run.restore_values`."""
        for generator, state in zip(self._generators(), values["generators"], strict=True):
            restore_generator(generator, state)
        for buffer, count in zip((self._anchors, self._declarations), values["counts"], strict=True):
            buffer.count = check_integer("count", count, minimum=0)
        for stream in self._streams:
            for env in stream.envs:
                check_tracks(env)

    def _generators(self) -> list[np.random.Generator]:
        return [self._generator, *(stream.generator for stream in self._streams)]

    def train_round(self) -> Round:
        """See `OwnNetworkRun.train_round`."""
        # one thread per stream; the samples do not depend on the order of completion
        with ThreadPoolExecutor(len(self._streams)) as pool:
            for rollout in pool.map(lambda one: one.rollout(self.net, self.settings), self._streams):
                self._anchors.add(rollout.anchors)
                self._declarations.add(rollout.declarations)
                self._recent = (self._recent + rollout.decisions)[-RECENT_STEPS:]
        self.set_learning_rate()
        totals = np.zeros(2)
        for _ in range(self.settings.batches):
            totals += self._update()
        losses = dict(zip(("anchor_loss", "regret_loss"), (totals / self.settings.batches).tolist(), strict=True))
        reward, ticks = np.mean(self._recent, axis=0) if self._recent else (math.nan, math.nan)
        return self._round_steps, float(reward), float(ticks), losses

    def is_logged(self) -> bool:
        """See `OwnNetworkRun.is_logged`."""
        return self._updates % LOG_EVERY == 0

    def _update(self) -> list[float]:
        """Make a step of the optimizer on random samples; return the losses of anchors and declarations."""
        losses = self._losses()
        self.optimizer.zero_grad(set_to_none=False)
        for loss in losses:
            if loss is not None:
                loss.backward()
        for part in (self.net.anchor, self.net.regret):
            nn.utils.clip_grad_norm_(part.parameters(), LARGEST_GRADIENT)
        self.optimizer.step()
        return [0.0 if loss is None else float(loss.detach()) for loss in losses]

    def _losses(self) -> tuple[Tensor | None, Tensor | None]:
        """Return the losses of random anchors and declarations; None without samples."""
        size, inputs = self.settings.batch_size, self.net.anchor.inputs
        of_anchors = of_regrets = None
        if self._anchors.count:
            rows = torch.from_numpy(self._anchors.draw(self._generator, size))
            of_anchors = self.net.anchor.loss(rows[:, :inputs], rows[:, inputs:])
        if self._declarations.count:
            *values, losses = self._declarations.draw(self._generator, size).astype(np.float64).T
            of_regrets = self.net.regret.loss(*regret_inputs(*values), torch.from_numpy(losses).float())
        return of_anchors, of_regrets
