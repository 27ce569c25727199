"""Training of the sequence agent: cross-entropy of the modes at every tick, likelihood of the anchor errors.

The network itself makes the decisions during training. The threshold on the error probability is drawn at
random after each declaration, and a fraction of the declarations is replaced by random hypotheses. The
anchors therefore include those after early, late and wrong decisions. Each rollout is one step of truncated
backpropagation through time. Besides fixed worlds there are random ones, which are drawn anew regularly.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily, sequence_family
from agents.evaluation.drawn_worlds import draw_world
from agents.learned.dimensionless import ratios, turns_per_tick
from agents.learned.regret_net import regret_inputs
from agents.learned.sequence import (
    SequenceNet,
    TickInputs,
    TrackFilters,
    check_declares_hypotheses,
    errors_and_best,
    posterior_of_tick,
    save_sequence,
)
from agents.training import run_folder
from agents.training.recipe import LARGEST_ALPHA, SequenceSettings, TrainingWorld, learning_rate_schedule
from agents.training.run import Run, TrainingProgress
from agents.training.track_state import check_tracks, track_arrays
from baselines.deciders.anchor_prior import anchor_errors
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.vector_env import HybridTrackVectorEnv

FloatArray = NDArray[np.float64]
MIN_LEARNING_RATE_FACTOR = 0.02  # lower bound of the linear decay
LOG_EVERY = 10  # updates
UNDECIDED_WEIGHT = 0.1  # of ticks at which the filters are too uncertain for a declaration
TYPICAL_ALPHAS = 0.003, 0.1  # thresholds of segments whose losses are learned
DECLARATION = 7  # values that describe a declaration, see `regret_net.regret_inputs`
RECENT_STEPS = 200  # environment steps with decisions that the displayed means are taken over


@dataclass
class _Rollout:
    """What the tracks of a stream met in T ticks.

    Attributes:
        inputs: of the network, one item per tick.
        modes: true modes (N,), one item per tick.
        anchor_inputs, anchor_errors: (n, 20 + C) and (n, 4) of the predicted anchors, one item per tick that
            has any.
        decisions: mean reward and decision time, one item per tick and environment with decisions.
    """

    inputs: list[TickInputs] = field(default_factory=list)
    modes: list[Tensor] = field(default_factory=list)
    anchor_inputs: list[Tensor] = field(default_factory=list)
    anchor_errors: list[Tensor] = field(default_factory=list)
    decisions: list[tuple[float, float]] = field(default_factory=list)
    declarations: list[FloatArray] = field(default_factory=list)


@dataclass
class _Gradient:
    """Contribution of one stream to an update.

    Attributes:
        parts: gradient of each parameter; None if the loss does not depend on it.
        losses: weighted, of modes and of anchors.
        decisions: see `_Rollout`.
    """

    parts: list[Tensor | None]
    losses: list[float]
    decisions: list[tuple[float, float]]


class _Stream:
    """Parallel tracks of environments with the same number of hypotheses, their filters and hidden state.

    Attributes:
        first: (N,) first row of an episode.
        hidden_state: (N, M, hidden) of the network after the last update.
        errors: (N, 4) error of the anchor in the heading frame, of the tracks that begin a segment.
        alpha: (N,) error probability at which a track declares.
    """

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int, hidden: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.splits = np.cumsum(counts)[:-1]
        self.rows: list[NDArray[np.float32]] = []
        for env, count in zip(envs, counts, strict=True):
            self.rows.append(env.reset(seed=first_seed)[0])
            first_seed += count
        self.tracks = sum(counts)
        self.layout = envs[0].world.layout
        self.filters = TrackFilters([env.options for env in envs], counts)
        self.hidden_state = torch.zeros(self.tracks, self.layout.hypotheses, hidden)
        self.by_type = np.repeat([env.options.correctness == "type" for env in envs], counts)
        self.first = np.ones(self.tracks, np.bool_)
        self.errors = np.zeros((self.tracks, 4))
        self.alpha = np.zeros(self.tracks)
        self.redraw = np.ones(self.tracks, np.bool_)
        self.declaration = np.full((self.tracks, DECLARATION), np.nan)

    def _observe_losses(
        self,
        rollout: _Rollout,
        observation: NDArray[np.float32],
        start: int,
        info: dict[str, Any],
        terminated: NDArray[np.bool_],
        delay_cost: float,
    ) -> None:
        """Record the losses of decisions together with the declarations before them."""
        decided = np.flatnonzero(info["_correct"])
        tracks = start + decided
        loss = np.where(info["correct"][decided], 0.0, 2.0) + delay_cost * info["ticks"][decided]
        low, high = TYPICAL_ALPHAS
        known = (
            ~np.isnan(self.declaration[tracks, 0]) & (low < self.alpha[tracks]) & (self.alpha[tracks] < high)
        )
        if known.any():
            pairs = np.concatenate([self.declaration[tracks], loss[:, None]], axis=1)
            rollout.declarations.append(pairs[known])
        rows, scales = observation[tracks], self.filters.scales.select(tracks)
        turn = turns_per_tick(self.layout, rows, scales)
        motion, process, *_ = ratios(self.layout, rows, scales)
        each = np.arange(len(tracks))
        new = np.stack(
            [
                turn[each, info["decided_mode"][decided]], turn[each, info["decided_true_mode"][decided]],
                motion, process, info["decided_length"][decided] - info["ticks"][decided],
                scales.follows_bank, scales.anchor_aware,
            ], axis=-1,
        )  # fmt: skip
        new[terminated[decided]] = np.nan
        self.declaration[tracks] = new

    def rollout(self, net: SequenceNet, settings: SequenceSettings) -> _Rollout:
        """Step all tracks T times with the current network."""
        hidden_state = self.hidden_state
        rollout = _Rollout()
        for _ in range(settings.n_steps):
            self._draw_thresholds(settings)
            observation = np.concatenate(self.rows)
            inputs = self.filters.advance(net, observation, self.first)
            rollout.inputs.append(inputs)
            true_modes = np.concatenate([env.world.field("true_mode") for env in self.envs])
            rollout.modes.append(torch.from_numpy(true_modes))
            if self.filters.anchor_samples is not None:
                of_anchor, factor, tracks = self.filters.anchor_samples
                white = np.linalg.solve(factor, self.errors[tracks][..., None])[..., 0]
                rollout.anchor_inputs.append(torch.from_numpy(of_anchor))
                rollout.anchor_errors.append(torch.from_numpy(white.astype(np.float32)))
            posterior, hidden_state = posterior_of_tick(net, inputs, hidden_state)
            self.filters.last.posterior = posterior
            error, best = errors_and_best(
                net, observation, self.filters.scales, posterior, self.by_type, self.alpha
            )
            at_last_tick = self.layout.read(observation, "ticks") >= settings.last_tick
            declares = (error <= self.alpha) | at_last_tick
            replaced = self.generator.random(self.tracks) < settings.random_declarations
            random_mode = self.generator.integers(self.layout.hypotheses, size=self.tracks)
            actions = np.where(declares, np.where(replaced, random_mode, best) + 1, 0)
            self.redraw = declares
            start = 0
            truths = [env.world.field("truth") for env in self.envs]
            for k, (env, part) in enumerate(zip(self.envs, np.split(actions, self.splits), strict=True)):
                self.rows[k], _, terminated, _, info = env.step(part)
                self.first[start : start + len(part)] = terminated
                if "correct" in info:
                    rollout.decisions.append(_mean_reward_and_ticks(info, env.options.delay_cost))
                    self._observe_losses(
                        rollout, observation, start, info, terminated, env.options.delay_cost
                    )
                    switched = np.flatnonzero(info["_correct"] & ~terminated)
                    self.errors[start + switched] = anchor_errors(env, switched, truths[k][switched])
                start += len(part)
        return rollout

    def loss(self, net: SequenceNet, rollout: _Rollout) -> tuple[Tensor, Tensor, Tensor]:
        """Return the mean negative log-posterior of the true mode and the mean loss of the anchors.

        The final hidden state is stored, detached.
        """
        own, track, log_weights = (
            torch.stack([getattr(one, name) for one in rollout.inputs])
            for name in ("own", "track", "log_weights")
        )
        features = net.features(own, track, log_weights.exp())
        hidden_state, hidden_states = self.hidden_state, []
        for one, feature in zip(rollout.inputs, features, strict=True):
            hidden_state = net.next_hidden_state(feature, hidden_state, one)
            hidden_states.append(hidden_state)
        self.hidden_state = hidden_state.detach()
        log_posterior = net.log_posterior(log_weights, torch.stack(hidden_states))
        modes = torch.stack(rollout.modes)
        losses = nn.functional.nll_loss(log_posterior.flatten(0, 1), modes.flatten(), reduction="none")
        error = 1.0 - log_weights.exp().amax(-1).flatten()
        relevance = torch.where(error < LARGEST_ALPHA, 1.0, UNDECIDED_WEIGHT)
        of_modes = (relevance * losses).sum() / relevance.sum()
        of_anchors = of_regrets = torch.zeros(())
        if rollout.anchor_inputs:
            of_anchors = net.anchor.loss(torch.cat(rollout.anchor_inputs), torch.cat(rollout.anchor_errors))
        if rollout.declarations:
            *values, losses = np.concatenate(rollout.declarations).T
            of_regrets = net.regret.loss(*regret_inputs(*values), torch.from_numpy(losses.astype(np.float32)))
        return of_modes, of_anchors, of_regrets

    def learn(self, net: SequenceNet, settings: SequenceSettings, weight: float) -> _Gradient:
        """Return the gradient of the weighted losses of a rollout."""
        rollout = self.rollout(net, settings)
        losses = list(self.loss(net, rollout))
        gradient = torch.autograd.grad(
            weight * torch.stack(losses).sum(), list(net.parameters()), allow_unused=True
        )
        return _Gradient(list(gradient), [weight * float(one.detach()) for one in losses], rollout.decisions)

    def state_tensors(self) -> dict[str, Tensor]:
        """Return all tensors that determine the next rollout; writing into them changes the stream."""
        arrays = {"first": self.first, "errors": self.errors, "alpha": self.alpha, "redraw": self.redraw}
        arrays["declaration"] = self.declaration
        arrays |= self.filters.state_arrays()
        for k, env in enumerate(self.envs):
            arrays |= {f"{k}.{name}": array for name, array in track_arrays(env).items()}
            arrays[f"{k}.rows"] = self.rows[k]
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
        return tensors | {"hidden_state": self.hidden_state}

    def _draw_thresholds(self, settings: SequenceSettings) -> None:
        new = self.redraw
        low, high = math.log(settings.smallest_alpha), math.log(LARGEST_ALPHA)
        self.alpha[new] = np.exp(self.generator.uniform(low, high, int(new.sum())))


def _mean_reward_and_ticks(info: dict[str, Any], delay_cost: float) -> tuple[float, float]:
    """Return mean reward and decision time of the decisions in one step."""
    decided: NDArray[np.bool_] = info["_correct"]
    ticks = info["ticks"][decided]
    outcome = np.where(info["correct"][decided], 1.0, -1.0)
    return float((outcome - delay_cost * ticks).mean()), float(ticks.mean())


class SequenceRun(Run):
    """A training run of the sequence agent; see `agents.training.runs.make_run` for the arguments.

    Raises:
        ArgumentError: an invalid environment, or a damaged checkpoint.
    """

    def build(self) -> None:
        """Create network, optimizer and environments."""
        assert isinstance(self.recipe.settings, SequenceSettings)
        self.settings = self.recipe.settings
        torch.manual_seed(self.seed)
        self.net = SequenceNet(self.settings.hidden)
        self.rate, self.decays = learning_rate_schedule(self.settings.learning_rate)
        self._optimizer = torch.optim.Adam(self.net.parameters(), lr=self.rate)
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._fixed = [self._options_of(world) for world in self.settings.worlds]
        for world in (self.world, *(world for world, _ in self._fixed)):
            check_declares_hypotheses(world)
        self._num_timesteps = 0
        self._generation = 0
        self._streams = self._draw_streams()
        self._tracks = sum(stream.tracks for stream in self._streams)

    @property
    def num_timesteps(self) -> int:
        """Environment steps so far."""
        return self._num_timesteps

    @num_timesteps.setter
    def num_timesteps(self, steps: int) -> None:
        self._num_timesteps = steps
        generation = steps // (self.settings.n_steps * self._tracks) // self.settings.updates_per_world
        if self.settings.drawn_worlds and generation != self._generation:
            self._generation = generation
            self._streams = self._draw_streams()

    @property
    def network(self) -> SequenceNet:
        """The sequence network."""
        return self.net

    @property
    def optimizer(self) -> torch.optim.Optimizer:
        """Its optimizer."""
        return self._optimizer

    def _draw_streams(self) -> list[_Stream]:
        """Return tracks of the fixed worlds and of random ones, one stream for each number of hypotheses."""
        first = seeds.TRAINING + self.seed * 10**9 + self._generation * 10**5
        generator = np.random.default_rng(first)
        worlds = list(self._fixed)
        for drawn in self.settings.drawn_worlds:
            options = [draw_world(generator, drawn.radii) for _ in range(drawn.worlds)]
            worlds += [(WorldOptions.of(**one), drawn.n_envs) for one in options]
        groups: dict[int, list[HybridTrackVectorEnv]] = {}
        for world, count in worlds:
            env = HybridTrackVectorEnv(
                count, AutoresetMode.SAME_STEP, False, world.longest_segment + 1, **vars(world)
            )
            groups.setdefault(world.hypotheses, []).append(env)
        return [
            _Stream(group, first + k * 10**4, self.settings.hidden) for k, group in enumerate(groups.values())
        ]

    def _options_of(self, world: TrainingWorld) -> tuple[WorldOptions, int]:
        options = self.options | dict(world.options)
        return make_vector_env(world.env or self.env_id, 1, **options).options, world.n_envs

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Run.track_tensors`."""
        return {
            f"{k}.{name}": tensor
            for k, stream in enumerate(self._streams)
            for name, tensor in stream.state_tensors().items()
        }

    def values(self) -> dict[str, Any]:
        """See `Run.values`."""
        return {"generators": [stream.generator.bit_generator.state for stream in self._streams]}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Run.restore_values`."""
        for stream, state in zip(self._streams, values["generators"], strict=True):
            stream.generator.bit_generator.state = state
            if stream.generator.bit_generator.state != state:  # NumPy rounds fractions
                raise ValueError("the state of a generator is invalid")
        for stream in self._streams:
            for env in stream.envs:
                check_tracks(env)

    def learn(self, on_progress: Callable[[TrainingProgress], None] | None) -> None:
        """Train for the remaining steps; see `Run.learn`."""
        parameters = list(self.net.parameters())
        of_anchors, of_regrets = (list(part.parameters()) for part in (self.net.anchor, self.net.regret))
        apart = {id(one) for one in of_anchors + of_regrets}
        of_modes = [one for one in parameters if id(one) not in apart]
        recent: list[tuple[float, float]] = []
        # one thread per stream; the sum of the gradients does not depend on the order of completion
        with ThreadPoolExecutor(len(self._streams)) as pool:
            while self.num_timesteps < self.steps:
                self.between_updates()
                remaining = 1.0 - self.num_timesteps / self.steps
                factor = max(MIN_LEARNING_RATE_FACTOR, remaining) if self.decays else 1.0
                for options in self.optimizer.param_groups:
                    options["lr"] = self.rate * factor
                gradients = list(pool.map(self._gradient, self._streams))
                for k, parameter in enumerate(parameters):
                    parts = [part for one in gradients if (part := one.parts[k]) is not None]
                    parameter.grad = torch.stack(parts).sum(0) if parts else None
                for one in gradients:
                    recent = (recent + one.decisions)[-RECENT_STEPS:]
                for group in (of_modes, of_anchors, of_regrets):
                    nn.utils.clip_grad_norm_(group, 1.0)
                self.optimizer.step()
                self.num_timesteps += self.settings.n_steps * self._tracks
                reward, ticks = np.mean(recent, axis=0) if recent else (math.nan, math.nan)
                if on_progress is not None:
                    progress = TrainingProgress(self.num_timesteps, self.steps, float(reward), float(ticks))
                    on_progress(progress)
                updates = self.num_timesteps // (self.settings.n_steps * self._tracks)
                if self.folder is not None and updates % LOG_EVERY == 0:
                    totals = np.sum([one.losses for one in gradients], axis=0).tolist()
                    metrics = dict(zip(("loss", "anchor_loss", "regret_loss"), totals, strict=True))
                    metrics["seconds"] = self.seconds
                    run_folder.append_metrics(self.folder, self.num_timesteps, metrics)

    def _gradient(self, stream: _Stream) -> _Gradient:
        return stream.learn(self.net, self.settings, stream.tracks / self._tracks)

    def family(self, name: str) -> DeciderFamily:
        """Return the current agent as a family of deciders for the environment of the run."""
        return sequence_family(name, self.net, self.world)

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the current agent."""
        save_sequence(folder, self.net, card)
