"""The jump-Markov net: motion and mixing in closed form, symmetry, one tick after the other,
learning.
"""

import numpy as np
import pytest
import torch

from agents.training.expected_reward import StatementBatch
from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from baselines.rules.measurements import OBSERVED
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv
from studies.league.families import recipe_file
from studies.league.jump_markov import (
    JumpMarkovDecider,
    JumpMarkovNet,
    coordinated_turn,
    track_inputs,
)

ENV = "hybrid_env:HybridTrackQuickest-v0"


@pytest.fixture(scope="module")
def run():
    torch.manual_seed(0)
    changes = ("n_envs=6", "hidden=8", "durations=[uniform 5-20]")
    run = make_run(
        ENV,
        {"ticks": 40, "durations": "uniform 5-20"},
        load_recipe(
            recipe_file("jump-markov"),
            ENV,
            changes,
        ),
    )
    for layers in (run.net.filter.gain, run.net.filter.covariance):
        torch.nn.init.normal_(layers[2].weight, std=0.05)
    torch.nn.init.normal_(
        run.net.modes.output.weight,
        std=0.3,
    )
    return run


def observed(world, ticks=12, tracks=4):
    """What the decider observes (T, N, width), while something is stated."""
    env = HybridTrackQuickestVectorEnv(
        tracks,
        autoreset_mode="Disabled",
        tick_info=False,
        **vars(world),
    )
    env.reset(seed=3)
    decider = JumpMarkovDecider(JumpMarkovNet(4), world)
    found = []
    for _ in range(ticks):
        found.append(decider.observe(env.world))
        env.step(np.zeros(tracks, np.int64))
    return np.array(found)


def outputs_of(net, world, seen):
    inputs = torch.from_numpy(np.array([track_inputs(world, one) for one in seen]))
    logs = torch.from_numpy(seen[..., OBSERVED : OBSERVED + world.hypotheses]).float()
    with torch.no_grad():
        return net(inputs, logs)


def test_a_turn_keeps_the_speed_and_the_distance_from_its_centre():
    motion = coordinated_turn(torch.tensor([0.6]))[0]
    velocity = torch.tensor([0.0, 0.0, 3.0, 4.0])
    after = motion @ velocity
    radius = 5.0 / 0.6

    assert float(after[2:].norm()) == pytest.approx(5.0, rel=1e-5)
    # To the left of the velocity.
    centre = radius * torch.tensor([-0.8, 0.6])
    assert float((after[:2] - centre).norm()) == pytest.approx(radius, rel=1e-5)
    # The chord.
    assert float(after[:2].norm()) == pytest.approx(2.0 * radius * np.sin(0.3), rel=1e-5)
    np.testing.assert_allclose(
        coordinated_turn(torch.zeros(1))[0] @ velocity,
        [3.0, 4.0, 3.0, 4.0],
        atol=1e-6,
    )


def test_filters_are_mixed_by_the_formula_of_the_interacting_multiple_model(run):
    net = JumpMarkovNet(8)
    generator = np.random.default_rng(0)
    probability = generator.dirichlet(np.ones(3), size=5)
    _, state = net.begin(
        torch.zeros(5, 8) + 1.0,
        torch.from_numpy(np.log(probability)).float(),
    )
    states = generator.normal(size=(5, 4, 4)).astype(np.float32)
    # Both filters of straight motion.
    states[:, 1] = states[:, 0]
    state = state._replace(
        filters=state.filters._replace(state=torch.from_numpy(states.reshape(20, 4)))
    )
    with torch.no_grad():
        predicted, mixed, kept = net._mix(
            state._replace(logs=torch.from_numpy(np.log(probability)).float())
        )
    hazard = 1.0 / (1.0 + np.exp(4.3))
    matrix = np.full((3, 3), hazard / 2.0)
    np.fill_diagonal(matrix, 1.0 - hazard)
    expected = probability @ matrix
    share = probability[:, :, None] * matrix / expected[:, None]

    np.testing.assert_allclose(
        predicted.exp(),
        expected,
        rtol=1e-4,
    )
    np.testing.assert_allclose(
        mixed,
        np.einsum(
            "nji,njk->nik",
            share,
            states[:, 1:],
        ),
        atol=1e-4,
    )
    np.testing.assert_allclose(
        kept.exp(),
        share.diagonal(axis1=1, axis2=2),
        rtol=1e-4,
    )


def test_a_statement_after_every_tick_is_that_of_the_whole_track_also_where_another_begins(run):
    seen = observed(run.world)
    outputs = outputs_of(
        run.net,
        run.world,
        seen,
    )
    decider = JumpMarkovDecider(run.net, run.world)
    state = None
    stated = []
    for one in seen:
        now, state = decider.decide(
            one,
            state,
            np.full(len(one), state is None),
        )
        stated.append(now)
    logs = torch.log_softmax(outputs.belief[-1], -1).clamp(min=-15.0)

    np.testing.assert_allclose(
        state.net.logs,
        logs,
        atol=1e-4,
    )
    starts = np.array([True, False, True, False])
    _, mixed = decider.decide(
        seen[0],
        state,
        starts,
    )
    _, fresh = decider.decide(
        seen[0],
        None,
        None,
    )
    for part, new in (
        (mixed.net.logs, fresh.net.logs),
        (mixed.net.memory[0], fresh.net.memory[0]),
    ):
        each = np.repeat(starts, len(part) // len(starts))
        np.testing.assert_allclose(
            part[each],
            new[each],
            atol=1e-5,
        )
        assert float((part[~each] - new[~each]).abs().max()) > 1e-3
    both = JumpMarkovDecider.together(
        [
            decider,
            JumpMarkovDecider(
                run.net,
                run.world,
                3.0,
            ),
        ]
    )
    state = None
    for one, expected in zip(
        seen,
        stated,
        strict=True,
    ):
        _, state = both.decide(
            one,
            state,
            np.full(len(one), state is None),
        )
        np.testing.assert_array_equal(both.chosen[0], expected)
    assert len(both.chosen) == 2


def test_a_mirrored_track_has_the_mirrored_belief_and_a_rotated_one_the_same(run):
    seen = observed(run.world)
    plain = outputs_of(
        run.net,
        run.world,
        seen,
    ).belief
    mirrored = seen.copy()
    # y.
    mirrored[..., [1, 4, 5]] *= -1.0
    mirrored[..., OBSERVED : OBSERVED + 3] = mirrored[..., [OBSERVED, OBSERVED + 2, OBSERVED + 1]]

    np.testing.assert_allclose(
        outputs_of(
            run.net,
            run.world,
            mirrored,
        ).belief[..., [0, 2, 1]],
        plain,
        atol=1e-2,
    )
    rotated = seen.copy()
    for x, y in ((0, 1), (2, 4), (3, 5)):
        rotated[..., x], rotated[..., y] = -seen[..., y], seen[..., x]
    np.testing.assert_allclose(
        outputs_of(
            run.net,
            run.world,
            rotated,
        ).belief,
        plain,
        atol=1e-2,
    )


def test_a_gain_is_learned_in_seconds():
    changes = (
        "n_envs=24",
        "batch_size=24",
        "n_steps=25",
        "durations=[25 + geometric 50]",
        "variances=[1, 1]",
    )
    run = make_run(
        ENV,
        {"ticks": 100},
        load_recipe(
            recipe_file("jump-markov"),
            ENV,
            (*changes, "hidden=8"),
        ),
        seed=1,
        steps=24_000,
    )
    torch.nn.init.zeros_(run.net.filter.gain[2].bias)
    inputs, logs, modes = (
        torch.from_numpy(one)
        for one in run.simulate(
            run.world,
            60,
            12345,
            False,
        )
    )
    batch = StatementBatch(
        inputs,
        logs,
        modes,
        torch.ones(modes.shape),
        torch.ones(modes.shape),
    )

    def loss():
        with torch.no_grad():
            return float(run.further_loss(run.net(inputs, logs), batch))

    before = loss()
    run.train()
    # Of measurements around the true positions.
    least = np.log(2.0 * np.pi) + 1.0

    assert least < loss() < least + 0.3
    assert before > least + 1.0
