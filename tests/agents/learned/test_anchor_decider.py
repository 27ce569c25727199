"""The anchor agent: invariances, which the learned stop shares, loss and decisions."""

import functools
from dataclasses import replace

import numpy as np
import pytest
import torch
from online_episodes import COMMON, same_as_announced
from scipy.stats import multivariate_normal

from agents.evaluation.registry import load_decider
from agents.learned.anchor_decider import AnchorDecider, AnchorNetworks, errors_and_best
from agents.learned.anchor_net import Scales
from agents.learned.stopping_decider import StoppingDecider, StoppingNetworks
from baselines import SPRTDecider
from baselines.rules import rollout
from hybrid_env import HybridTrackVectorEnv, Layout, WorldOptions

evaluate = functools.partial(rollout.evaluate, env_id="hybrid_env:HybridTrackPublished-v0")

TRACKS, TICKS = 16, 150


def random_net(seed=0, hidden=12):
    """Networks whose predictions depend on all of their inputs."""
    torch.manual_seed(seed)
    net = AnchorNetworks(hidden)
    torch.nn.init.normal_(
        net.anchor.output.weight,
        std=0.02,
    )
    return net


def anchor_agent(world):
    return AnchorDecider(random_net(), world, 0.02)


def stopping_agent(world):
    torch.manual_seed(0)
    net = StoppingNetworks(12)
    torch.nn.init.normal_(
        net.anchor.output.weight,
        std=0.02,
    )
    torch.nn.init.normal_(
        net.stopping.output.weight,
        std=0.3,
    )
    return StoppingDecider(net, world)


every = pytest.mark.parametrize("agent", [anchor_agent, stopping_agent])


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
        "curvature",
    ):
        out[:, layout.slices[name]] = rows[:, layout.slices[name]][:, order]
    for name in ("innovation_across", "curvature", "displacement_across"):
        out[:, layout.slices[name]] *= -1
    return out, order


def posteriors_of(decider, env, ticks=TICKS, transform=lambda rows: rows, declare=True):
    """Posterior (ticks, N, M) in an environment in which one track after the other declares."""
    rows, _ = env.reset(seed=3)
    state = None
    start = np.ones(env.num_envs, np.bool_)
    posteriors = []
    for tick in range(ticks):
        posterior, state = decider.posterior(transform(rows), state, start)
        posteriors.append(posterior)
        due = declare & (np.arange(env.num_envs) == tick % env.num_envs)
        actions = np.where(due, 1 + tick % posterior.shape[1], 0)
        rows, _, start, _, _ = env.step(actions)
    return np.array(posteriors)


def in_other_units(world, length, time):
    """The same world, with lengths and times in other units."""
    error, velocity_variance = world.initial_error
    return WorldOptions.of(
        **vars(world)
        | {
            "radii": tuple(radius * length for radius in world.radii),
            "speed": world.speed * length / time,
            "tau": world.tau * time,
            "process_variance": world.process_variance * (length / time) ** 2,
            "measurement_variance": tuple((world.variances * length**2).tolist() * 2)[:2],
            "initial_error": (error, velocity_variance * (length / time) ** 2),
        }
    )


@every
@pytest.mark.parametrize(
    ("options", "length", "time"),
    [
        ({"bank": "anchor_aware", "radii": (3.0, 6.0), "correctness": "type"}, 1.0, 60.0),
        (
            {
                "bank": "anchor_aware",
                "follow": "bank",
                "measurement_variance": (0.05, 0.2),
                "noise": "outliers 0.05",
            },
            0.3048,
            1e-3,
        ),
    ],
)
def test_a_change_of_units_changes_no_decision(options, length, time, agent):
    world = WorldOptions.of(**options)
    results = []
    actions = []
    for options in (world, in_other_units(world, length, time)):
        decider = agent(options)
        results.append(posteriors_of(decider, HybridTrackVectorEnv(TRACKS, **vars(options))))
        actions.append(evaluate(decider, episodes=20, seed=1, **vars(options)))

    np.testing.assert_allclose(*results, atol=1e-4)
    np.testing.assert_array_equal(actions[0].ticks, actions[1].ticks)
    np.testing.assert_array_equal(actions[0].decided_mode, actions[1].decided_mode)


@every
@pytest.mark.parametrize("radii", [(2.0, 5.0, 9.0)])
def test_a_mirrored_trajectory_gives_the_mirrored_posterior(radii, agent):
    env = HybridTrackVectorEnv(TRACKS, radii=radii)
    decider = agent(env.options)
    order = mirrored(env.reset(seed=0)[0])[1]
    original = posteriors_of(decider, env)
    reflected = posteriors_of(decider, env, transform=lambda rows: mirrored(rows)[0])

    np.testing.assert_allclose(reflected, original[..., order], atol=1e-4)


@every
def test_one_network_applies_to_any_bank_and_does_not_depend_on_the_order_of_radii(agent):
    posteriors = []
    for radii in ((2.0, 5.0, 9.0), (9.0, 5.0, 2.0)):
        env = HybridTrackVectorEnv(TRACKS, radii=radii, scheme="S60 L60r5 S60")
        decider = agent(env.options)
        posteriors.append(posteriors_of(decider, env, ticks=20, declare=False))
    order = [0, 3, 2, 1, 6, 5, 4]

    np.testing.assert_allclose(
        posteriors[0],
        posteriors[1][..., order],
        atol=1e-4,
    )


def test_the_loss_of_the_anchors_is_the_density_of_the_mixture():
    net = random_net().anchor
    inputs, errors = torch.randn(5, net.inputs), torch.randn(5, 4)
    with torch.no_grad():
        log_weight, mean, factor = net(inputs)
        weight = log_weight.exp().double()
        covariance = (factor @ factor.mT).double()
        density = [
            sum(
                weight[i, c]
                * multivariate_normal(mean[i, c].double(), covariance[i, c]).pdf(errors[i])
                for c in range(weight.shape[1])
            )
            for i in range(5)
        ]
        assert net.loss(inputs, errors).item() == pytest.approx(-np.log(density).mean(), rel=1e-4)


def test_a_wrong_radius_costs_what_the_network_predicts_where_only_the_type_is_rewarded():
    world = WorldOptions(radii=(2.0, 2.0001, 8.0), correctness="type")
    rows, _ = HybridTrackVectorEnv(3, **vars(world)).reset(seed=0)
    posterior = np.array(
        [[0.0, 0.5, 0.5, 0, 0, 0, 0], [0.0, 0.5, 0, 0.5, 0, 0, 0], [0.2, 0.4, 0.4, 0, 0, 0, 0]]
    )
    net = random_net()

    def declared(world, by_type):
        scales = Scales.of([world], [3])
        return errors_and_best(net, rows, scales, posterior, np.full(3, by_type), np.full(3, 0.1))

    error, best = declared(world, True)
    # Both turns are the same.
    assert error[0] == pytest.approx(0.0, abs=1e-5)
    assert error[1] > 0.01
    # Above alpha: nothing is declared, and nothing is added.
    assert error[2] == pytest.approx(0.2)
    assert (best > 0).all()
    exact, _ = declared(world, False)
    np.testing.assert_allclose(exact, [0.5, 0.5, 0.6])
    # The next anchor is the same after any turn.
    error, _ = declared(replace(world, follow="bank"), True)
    np.testing.assert_allclose(error, [0.0, 0.0, 0.2], atol=1e-12)


@pytest.mark.parametrize("options", [{}])
def test_the_shipped_agent_beats_the_sprt_at_any_threshold(options):
    decider = load_decider("shipped-threshold", WorldOptions(**options))
    reward = evaluate(decider, episodes=100, seed=50, **options).reward.mean(1)
    for alpha in (1e-2, 1e-6):
        gain = reward - evaluate(SPRTDecider(alpha), episodes=100, seed=50, **options).reward.mean(
            1
        )
        assert gain.mean() > 4 * gain.std() / 10


@pytest.mark.parametrize("correctness", ["exact", "type"])
@pytest.mark.parametrize("name", ["axes"])
def test_the_shipped_agent_decides_on_a_live_sensor_as_in_the_environment(name, correctness):
    options = {"correctness": correctness, **COMMON[name]}
    decided = same_as_announced(
        load_decider("shipped-threshold:0.03", WorldOptions(**options)),
        seed=6,
        **options,
    )

    assert not all(forced for _, forced in decided)
