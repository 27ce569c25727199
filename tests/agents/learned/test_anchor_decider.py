"""The anchor agent: invariances and decisions."""

import functools

import numpy as np
import torch
from online_episodes import COMMON, same_as_announced
from other_units import in_other_units

from agents.evaluation.registry import load_decider
from agents.learned.anchor_decider import AnchorDecider
from agents.learned.anchor_net import AnchorNetworks
from baselines import SPRTDecider
from baselines.rules import rollout
from hybrid_env import HybridTrackVectorEnv, Layout, WorldOptions

record_decisions = functools.partial(
    rollout.record_decisions, env_id="hybrid_env:HybridTrackPublished-v0"
)

TRACKS, TICKS = 16, 80


def random_agent(world, hidden=12):
    """An agent whose predictions depend on all inputs of its networks."""
    torch.manual_seed(0)
    net = AnchorNetworks(hidden)
    torch.nn.init.normal_(net.anchor.output.weight, std=0.02)
    torch.nn.init.normal_(net.stopping.output.weight, std=0.3)
    return AnchorDecider(net, world)


def mirrored(rows):
    """Observation rows of the mirrored trajectory, with left and right turns exchanged."""
    layout = Layout.of_rows(rows)
    M = layout.hypotheses
    n = layout.hypotheses // 2
    order = np.array([0, *range(n + 1, M), *range(1, n + 1)])
    out = rows.copy()
    for name in (
        "log_ratio",
        "innovation_along",
        "innovation_across",
        "log_variance",
        "previous",
        "turn_angle",
    ):
        out[:, layout.slices[name]] = rows[:, layout.slices[name]][:, order]
    for name in ("innovation_across", "turn_angle", "displacement_across"):
        out[:, layout.slices[name]] *= -1
    return out, order


def posteriors_of(decider, env, transform=lambda rows: rows, declare=True):
    """Posterior (ticks, N, M) in an environment in which one track after the other declares."""
    rows, _ = env.reset(seed=3)
    state = None
    start = np.ones(env.num_envs, np.bool_)
    posteriors = []
    for tick in range(TICKS):
        state = decider.advance(transform(rows), state, start)
        posteriors.append(state.posterior)
        due = declare & (np.arange(env.num_envs) == tick % env.num_envs)
        actions = np.where(due, 1 + tick % env.options.hypotheses, 0)
        rows, _, start, _, _ = env.step(actions)
    return np.array(posteriors)


def test_a_change_of_units_changes_no_posterior():
    world = WorldOptions(
        bank="anchor_aware",
        radii=(3.0, 6.0),
        correctness="type",
        measurement_variance=(0.05, 0.2),
        noise="outliers 0.05",
    )
    results = []
    for options in (world, in_other_units(world, 0.3048, 60.0)):
        decider = random_agent(options)
        results.append(posteriors_of(decider, HybridTrackVectorEnv(TRACKS, **vars(options))))

    np.testing.assert_allclose(*results, atol=1e-4)


def test_a_mirrored_trajectory_gives_the_mirrored_posterior():
    env = HybridTrackVectorEnv(TRACKS, radii=(2.0, 5.0, 9.0))
    decider = random_agent(env.options)
    order = mirrored(env.reset(seed=0)[0])[1]
    original = posteriors_of(decider, env)
    reflected = posteriors_of(decider, env, transform=lambda rows: mirrored(rows)[0])

    np.testing.assert_allclose(reflected, original[..., order], atol=1e-4)


def test_the_shipped_agent_beats_the_sprt_at_any_threshold():
    given = {"env_id": "HybridTrackPublished-v0", "episodes": 100, "seed": 50}
    reward = record_decisions(load_decider("shipped", WorldOptions()), **given).reward.mean(1)
    for alpha in (1e-2, 1e-6):
        gain = reward - record_decisions(SPRTDecider(alpha), **given).reward.mean(1)
        assert gain.mean() > 4 * gain.std() / 10


def test_the_shipped_agent_decides_on_a_live_sensor_as_in_the_environment():
    options = {"correctness": "type", **COMMON["axes"]}
    shipped = load_decider("shipped:-3", WorldOptions(**options))

    assert not all(forced for _, forced in same_as_announced(shipped, seed=6, **options))
