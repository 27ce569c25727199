"""The learned stop, trained on the expected reward of whole segments.

Waiting does not change the object, so that a segment that runs to its end shows what a declaration
at each of its ticks would have earned. The network gives the probability of declaring at every
tick, and the expected reward of the segment is differentiated as it stands; deep optimal stopping,
Becker, Cheridito & Jentzen 2019. What a wrong radius costs in the next segment is the prediction of
the anchor agent. Half of the segments are decided by the agent in training, so that the anchors are
those which follow its own declarations.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

from agents import RowRatios, find_decider, regret_inputs
from hybrid_env import ArgumentError, WorldOptions
from studies.arrays import Float32Array, FloatArray, IntArray
from studies.shipped.explorer import Count, Explorer, WorldsAlgorithm, WorldsSettings
from studies.shipped.random_worlds import log_uniform


@dataclass(frozen=True, kw_only=True)
class StoppingSettings(WorldsSettings):
    """Hyper-parameters of the learned stop."""

    # Segments of an update.
    batch_size: Count
    # Times that the segments of a round are used.
    passes: Count
    # Bounds of the delay cost; half of the environments have one drawn between them.
    delay_costs: tuple[float, float] = (0.003, 0.05)
    # Largest number of ticks between decisions; half of the environments have one from 1 on.
    most_ticks: Count = 12
    # Bounds of factors on numbers among the options, by their names; three quarters of the
    # environments have one drawn for each of them, uniform in its logarithm.
    factors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Agent whose networks are used, with as many hidden units; or its run folder.
    agent: str = "shipped"


class Stopping(WorldsAlgorithm):
    """A training run of the learned stop, which goes on from that of an agent; its other networks
    stay as they are.
    """

    Settings = StoppingSettings
    settings: StoppingSettings

    def create_network(self) -> nn.Module:
        """See `NetworkAlgorithm.create_network`; the networks are those of the anchor agent."""
        network = super().create_network()
        agent: Any = find_decider(self.settings.agent, self.world)
        try:
            network.load_state_dict(agent.net.state_dict())
        except (AttributeError, RuntimeError):
            allowed = f"an anchor agent of {self.settings.hidden} units"
            raise ArgumentError(f"agent={self.settings.agent}: expected {allowed}") from None
        return network

    def prepare(self) -> None:
        """See `WorldsAlgorithm.prepare`; refuse factors on options that are no numbers."""
        super().prepare()
        for name in self.settings.factors:
            for world, _ in self._fixed:
                if np.asarray(getattr(world, name, None)).dtype.kind not in "fi":
                    raise ArgumentError(f"factors={name}: expected an option that is a number")

    def changed_world(self, world: WorldOptions, generator: np.random.Generator) -> WorldOptions:
        """See `WorldsAlgorithm.changed_world`: half of the environments have another delay cost,
        half of them other ticks between decisions, and three quarters other numbers.
        """
        changes: dict[str, Any] = {}
        if self.settings.factors and generator.random() < 0.75:
            for name, bounds in self.settings.factors.items():
                factor = log_uniform(generator, *bounds)
                changes[name] = np.multiply(getattr(world, name), factor)
        if generator.random() < 0.5:
            costs = self.settings.delay_costs
            changes["delay_cost"] = float(log_uniform(generator, min(costs), max(costs)))
        if generator.random() < 0.5:
            longest = min(self.settings.most_ticks, world.shortest_segment)
            changes["decide_every"] = round(log_uniform(generator, 1, longest))
        return WorldOptions(**{**vars(world), **changes})

    def draw_margins(self, generator: np.random.Generator, tracks: int) -> FloatArray:
        """See `WorldsAlgorithm.draw_margins`: infinite where a segment runs to its end."""
        drawn = generator.normal(0.0, 1.0, tracks)
        return np.where(generator.random(tracks) < 0.5, np.inf, drawn)

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        """See `NetworkAlgorithm.train_round`."""
        generator = np.random.default_rng(self.first_seed)
        paths = [paths_of(explorer) for explorer in self.explorers(generator)]
        inputs, rewards, lengths = (np.concatenate(parts) for parts in zip(*paths, strict=True))
        segments = [torch.from_numpy(part).split(lengths.tolist()) for part in (inputs, rewards)]
        totals = []
        self.set_learning_rate()
        for _ in range(self.settings.passes):
            order = generator.permutation(lengths.size)
            for start in range(0, lengths.size, self.settings.batch_size):
                chosen = order[start : start + self.settings.batch_size]
                seen, earnings = (
                    pad_sequence([part[k] for k in chosen], batch_first=True) for part in segments
                )
                ticks = torch.arange(earnings.shape[1])
                inside = ticks < torch.from_numpy(lengths[chosen])[:, None] - 1
                logits = self.network.stopping(seen)
                earned = expected_reward(logits, earnings, inside)
                decided = expected_reward(logits.detach(), (ticks + 1).expand_as(logits), inside)
                self.improve(-earned.mean(), 1.0, self.network.stopping)
                totals.append((float(earned.detach().mean()), float(decided.mean())))
        reward, delay = np.mean(totals, axis=0).tolist()
        return len(inputs), reward, delay, {"expected_reward": reward}


@torch.no_grad()
def paths_of(explorer: Explorer) -> tuple[Float32Array, Float32Array, IntArray]:
    """Run the episodes of an agent in training; return the S segments that ran to their ends.

    Returns:
        (n, 31) inputs of the network, one segment after the other; (n,) rewards of a declaration
        at each decision, what it costs in the next segment included; and (S,) numbers of decisions.
    """
    env, world = explorer.env, explorer.world
    nothing = np.zeros(env.num_envs, np.int64)
    steps = [
        (now.info.get("decided_true_mode", nothing), going) for now, _, going in explorer.ticks()
    ]
    # (N, T) and more.
    modes, going = (np.stack(parts, 1) for parts in zip(*steps, strict=True))
    inputs, rows, best, margins, counts, stops = (
        np.stack(parts, 1)
        for parts in zip(
            *(
                (seen.inputs, seen.rows, seen.best, seen.margin, seen.counts, seen.stops)
                for seen in explorer.seen
            ),
            strict=True,
        )
    )
    kept = np.isinf(margins) & going & counts
    ends = np.where(kept & stops)
    ratios = RowRatios(world, rows[kept])
    ticks = explorer.agent.layout.read(rows[ends], "ticks")
    lengths = np.ceil(ticks.round() / world.decide_every).astype(np.int64)
    best, true = best[kept], np.repeat(modes[ends], lengths)
    right = world.groups[best] == world.groups[true]
    rewards = world.segment_reward(right, ratios.read("ticks"))
    if world.follow != "bank":
        turns = (ratios.of_mode(ratios.turn, modes)[:, None] for modes in (best, true))
        regret = explorer.agent.net.regret(torch.from_numpy(regret_inputs(ratios, *turns)[:, 0]))
        rewards = rewards - regret.double().numpy()
    return inputs[kept], rewards.astype(np.float32), lengths


def expected_reward(logits: Tensor, rewards: Tensor, waits: Tensor) -> Tensor:
    """Return the expected reward (S,) of segments.

    Args:
        logits: (S, T) log-odds of declaring at a tick, if none before has declared.
        rewards: (S, T) of a declaration at this tick.
        waits: (S, T) where the agent may wait: all ticks of the segment but the last, at which it
            must declare.
    """
    pad, log_sigmoid = nn.functional.pad, nn.functional.logsigmoid
    stays = torch.where(waits, log_sigmoid(-logits), 0.0).cumsum(-1)
    declares = torch.where(waits, log_sigmoid(logits), 0.0)
    # Up to the last tick of the segment.
    inside = pad(waits, (1, 0), value=True)[:, :-1]
    return ((pad(stays, (1, 0))[:, :-1] + declares).exp() * rewards * inside).sum(-1)
