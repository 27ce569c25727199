"""The learned stop, trained on the expected reward of whole segments.

Waiting does not change the object, so that a segment that runs to its end shows what a declaration
at each of its ticks would have earned. The network gives the probability of declaring at every
tick, and the expected reward of the segment is differentiated as it stands; deep optimal stopping,
Becker, Cheridito & Jentzen 2019. What a wrong radius costs in the next segment is the prediction of
the anchor agent. Half of the segments are decided by the agent in training, so that the anchors are
those which follow its own declarations.

A round is determined by its number: a checkpoint between two rounds needs no tracks.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from agents.evaluation.registry import policy_folder
from agents.learned.anchor_net import Scales, declaration_context, regret_inputs, turns_per_tick
from agents.learned.policy_file import load_policy, load_weights
from agents.learned.stopping_decider import StoppingDecider
from agents.training.algorithm import Round
from agents.training.settings import Factors, WorldsSettings
from agents.training.worlds import WorldsAlgorithm
from baselines.recordings.log_uniform import log_uniform
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, Actions, Decider, Observations
from baselines.rules.msprt import error_and_best, mode_types
from baselines.rules.rollout import rollout
from hybrid_env.checks import Count, Float32Array, IntArray, reject
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv


@dataclass(frozen=True, kw_only=True)
class StoppingSettings(WorldsSettings):
    """Hyper-parameters of the learned stop, trained on one episode of each track in every round."""

    # Segments of an update.
    batch_size: Count
    # Times that the segments of a round are used.
    passes: Count
    # Smallest and largest delay cost; half of the environments have one drawn between them.
    delay_costs: Factors = (0.003, 0.05)
    # Or the run folder of an anchor agent, with as many hidden units.
    agent: str = "shipped-threshold"


class Paths(NamedTuple):
    """S segments that ran to their ends, with n ticks."""

    # (n, 30) one segment after the other.
    inputs: Float32Array
    # (n,) of a declaration at each tick, what it costs in the next segment included.
    rewards: Float32Array
    # (S,)
    lengths: IntArray


class Explorer(Decider):
    """An agent in training that lets half of the segments run to their ends, and remembers what
    it has seen.
    """

    observes = "tracks"

    def __init__(self, agent: StoppingDecider, generator: np.random.Generator):
        self.agent, self.generator = agent, generator
        self.seen: list[tuple[Any, ...]] = []
        self.layout = agent.layout

    def observe(self, tracks: Any) -> Observations:
        """See `Decider.observe`."""
        return self.agent.observe(tracks)

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state is that of the agent, and margins (N,), infinite where
        a segment runs on.
        """
        inner, margin = state or (None, np.zeros(len(observation)))
        inputs, logits, posterior, inner = self.agent.logits(observation, inner, episode_start)
        rows = np.asarray(observation)[:, : self.layout.width]
        tracks = len(rows)
        drawn = self.generator.normal(0.0, 1.0, tracks)
        drawn[self.generator.random(tracks) < 0.5] = np.inf
        margin = np.where(self.layout.read(rows, "ticks") < 1.5, drawn, margin)
        stops = (logits > margin) | (self.layout.read(rows, "ticks_left") < 0.5)
        best = error_and_best(posterior, self.agent.by_type)[1]
        self.seen.append((inputs, rows, best, np.isinf(margin), stops))
        return self.agent.declarations(observation, posterior, inner, stops), (inner, margin)

    def paths(self, env: HybridTrackVectorEnv, seed: int) -> Paths:
        """Run one episode of every track; return the segments that ran to their ends."""
        unfinished = np.ones(env.num_envs, np.bool_)
        modes = []
        going = []
        nothing = np.zeros(env.num_envs, np.int64)
        for now in rollout(env, self, seed):
            if now.step:
                modes.append(now.info.get("decided_true_mode", nothing))
                unfinished = unfinished & ~now.terminated
            if not unfinished.any():
                break
            going.append(unfinished)
        inputs, rows, best, runs_on, stops = (
            np.stack(parts, 1) for parts in zip(*self.seen, strict=True)
        )
        # (N, T)
        kept = runs_on & np.stack(going, 1)
        ends = np.where(kept & stops)
        lengths = np.round(self.layout.read(rows[ends], "ticks")).astype(np.int64)
        true = np.repeat(np.stack(modes, 1)[ends], lengths)
        rewards = self.rewards(rows[kept], best[kept], true)
        return Paths(inputs[kept], rewards, lengths)

    def rewards(self, rows: Observations, best: IntArray, true: IntArray) -> Float32Array:
        """Return the rewards (n,) of declarations at rows (n, width), their cost in the next
        segment subtracted.
        """
        agent, kind = self.agent, mode_types(self.layout.hypotheses)
        right = kind[best] == kind[true] if agent.by_type else best == true
        rewards = np.where(right, 1.0, -1.0) - agent.world.delay_cost * self.layout.read(
            rows,
            "ticks",
        )
        if agent.world.follow != "bank":
            scales = Scales.of([agent.world], [len(rows)])
            turn = turns_per_tick(self.layout, rows, scales)
            each = np.arange(len(rows))
            context = declaration_context(self.layout, rows, scales)
            inputs = regret_inputs(turn[each, best], turn[each, true], *context)
            with torch.no_grad():
                rewards = rewards - agent.net.regret.regret(*inputs).double().numpy()
        return rewards.astype(np.float32)


class Stopping(WorldsAlgorithm):
    """A training run of the learned stop; the networks of an anchor agent are read and stay as
    they are.
    """

    name = "stopping"
    Settings = StoppingSettings
    smallest_factor: ClassVar[float] = 0.02
    decider = StoppingDecider
    settings: StoppingSettings

    def create_network(self) -> nn.Module:
        """See `NetworkAlgorithm.create_network`; with the networks of the anchor agent."""
        network = super().create_network()
        weights = load_policy(policy_folder(self.settings.agent, ANNOUNCED)).weights
        untrained = {
            name: tensor
            for name, tensor in network.state_dict().items()
            if name.startswith("stopping.")
        }
        try:
            load_weights(network, weights | untrained)
        except ValueError as error:
            allowed = f"an anchor agent of {self.settings.hidden} units ({error})"
            raise reject("agent", self.settings.agent, allowed) from None
        return network

    def train_round(self) -> Round:
        """See `Algorithm.train_round`."""
        first = seeds.TRAINING + self.seed * 10**9 + self.rounds * 10**4
        generator = np.random.default_rng(first)
        paths = []
        seed = first
        for world, tracks in self._worlds(generator):
            env = HybridTrackVectorEnv(tracks, tick_info=False, **vars(world))
            paths.append(Explorer(StoppingDecider(self.net, world), generator).paths(env, seed))
            seed += tracks
        inputs, rewards, lengths = (np.concatenate(parts) for parts in zip(*paths, strict=True))
        begins = lengths.cumsum() - lengths
        totals = []
        self.set_learning_rate()
        for _ in range(self.settings.passes):
            order = generator.permutation(lengths.size)
            for start in range(0, lengths.size, self.settings.batch_size):
                chosen = order[start : start + self.settings.batch_size]
                ticks = np.arange(lengths[chosen].max())
                rows = begins[chosen][:, None] + np.minimum(ticks, lengths[chosen][:, None] - 1)
                inside = torch.from_numpy(ticks < lengths[chosen][:, None] - 1)
                logits = self.net.stopping(torch.from_numpy(inputs[rows]))
                earned = expected_reward(logits, torch.from_numpy(rewards[rows]), inside)
                decided = expected_reward(
                    logits.detach(),
                    torch.from_numpy(ticks + 1).expand(rows.shape),
                    inside,
                )
                self.improve(-earned.mean(), 1.0, self.net.stopping)
                totals.append((float(earned.detach().mean()), float(decided.mean())))
        reward, delay = np.mean(totals, axis=0).tolist()
        return len(inputs), reward, delay, {"expected_reward": reward}

    def _worlds(self, generator: np.random.Generator) -> list[tuple[WorldOptions, int]]:
        """Return the environments of a round and their numbers of tracks; half of them with
        another delay cost.
        """
        worlds = []
        for world, tracks in self.all_worlds(generator):
            cost = (
                float(log_uniform(generator, *self.settings.delay_costs))
                if generator.random() < 0.5
                else world.delay_cost
            )
            worlds.append((WorldOptions.of(**{**vars(world), "delay_cost": cost}), tracks))
        return worlds


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
