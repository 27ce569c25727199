"""What each step from ATE to the bound is worth: mean reward and paired differences on the same episodes."""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from agents.evaluation.cells import signed
from agents.evaluation.deciders import decider_family
from agents.evaluation.evaluate import FloatArray, confidence_interval, evaluate
from agents.evaluation.operating_curve import Estimate, sweep
from agents.interface.parallel import Call
from agents.limits.study import BANK_ENV, NOISE_LEVELS, THREE_MODE_ENV
from baselines.rules import seeds
from hybrid_env.registration import make_vector_env

AWARE: dict[str, Any] = {"bank": "anchor_aware"}
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is fitted in simulation": ("calibrated", {}),
    "MSPRT on the anchor-aware bank, which reads the full covariance": ("msprt-aware", AWARE),
    "all filters run on, and the next anchor is merged": ("msprt-aware", AWARE | {"follow": "bank"}),
    "the anchor is exact (oracle, not available in practice)": ("msprt", {"bank": "oracle"}),
}
"""Decider and changed options of each step, in the order of their information."""


@dataclass(frozen=True)
class StepResult:
    """Mean reward of one step at one noise level.

    Attributes:
        env_id: registered id of the environment.
        noise: variance R of a measured coordinate [m^2].
        step: key of `STEPS`.
        threshold: selected on other episodes.
        reward: mean per segment.
        gain: difference to the step before on the same episodes, None for the first.
    """

    env_id: str
    noise: float
    step: str
    threshold: float
    reward: Estimate
    gain: Estimate | None


def step_calls(env_id: str, episodes: int, seed: int) -> dict[str, Call]:
    """Return the calls of `evaluate_step` for every noise level and step; see `study.rule_calls`."""
    return {
        f"{env_id.rpartition(':')[2]}, {step}, R = {noise:g}": functools.partial(
            evaluate_step, env_id, noise, step, episodes, seed
        )
        for noise in NOISE_LEVELS
        for step in STEPS
    }


def evaluate_step(
    env_id: str, noise: float, step: str, episodes: int, seed: int
) -> tuple[StepResult, FloatArray]:
    """Evaluate a step at a noise level.

    Returns:
        The result, without its gain, and the mean reward of each episode, (episodes,).
    """
    name, changes = STEPS[step]
    options: dict[str, Any] = {"measurement_variance": noise, **changes}
    world = make_vector_env(env_id, 1, **options).options
    by_type = name == "msprt" and world.correctness == "type"
    family = decider_family("msprt-type" if by_type else name, world)
    selection = sweep(family, env_id, max(episodes // 3, 50), seeds.SELECTION, **options)
    threshold = family.thresholds[selection.best_index()]
    rewards = evaluate(family.make(threshold), env_id, episodes, seed, **options).reward.mean(1)
    reward = Estimate(float(rewards.mean()), *confidence_interval(rewards))
    return StepResult(env_id, noise, step, threshold, reward, None), rewards


def with_gains(found: Iterable[tuple[StepResult, FloatArray]]) -> list[StepResult]:
    """Return the results of `step_calls`, in their order, with the gain over the step before."""
    results: list[StepResult] = []
    before: FloatArray | None = None
    for result, rewards in found:
        gain = None
        if before is not None and result.step != next(iter(STEPS)):
            difference = rewards - before
            gain = Estimate(float(difference.mean()), *confidence_interval(difference))
        results.append(replace(result, gain=gain))
        before = rewards
    return results


def steps_markdown(found: Sequence[StepResult]) -> str:
    """Return one table per environment, with steps in rows and noise levels in columns."""
    lines = []
    for env_id in (THREE_MODE_ENV, BANK_ENV):
        lines += [
            f"### From ATE to the bound on {env_id.rpartition(':')[2]}", "",
            "Mean reward per segment; in brackets the gain over the row before, with its 95 % interval.", "",
            "| step | " + " | ".join(f"R = {noise:g}" for noise in NOISE_LEVELS) + " |",
            "|---|" + "---|" * len(NOISE_LEVELS),
        ]  # fmt: skip
        for step in STEPS:
            chosen = [one for one in found if (one.env_id, one.step) == (env_id, step)]
            cells = [reward_cell(one.reward, one.gain) for one in chosen]
            lines.append(f"| {step} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def reward_cell(reward: Estimate, gain: Estimate | None) -> str:
    """Return a mean reward, with the gain over the step before and its interval if there is one."""
    return f"{reward.value:.3f}" if gain is None else f"{reward.value:.3f} ({signed(gain, 3)})"
