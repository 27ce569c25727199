"""The agent that states the present mode: invariances, one tick at a time, files."""

import numpy as np
import pytest
import torch

from agents.learned.statement_decider import StatementDecider
from agents.learned.statement_net import INPUTS, StatementNet, statement_inputs
from agents.training.statements import simulate
from baselines import ThresholdDecider, record_statements
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, QuickestOptions

TRACKS = 12


def random_net(hidden=8, seed=0):
    """A network whose outputs depend on all of its inputs."""
    torch.manual_seed(seed)
    net = StatementNet(hidden)
    torch.nn.init.normal_(net.output.weight, std=0.5)
    return net.eval()


def statements_of(decider, options, transform=lambda rows: rows, ticks=150):
    """Statements (T, N) of a decider whose rows are transformed, and the rows."""
    env = HybridTrackQuickestVectorEnv(TRACKS, **vars(options))
    rows, _ = env.reset(seed=3)
    state, stated, seen = None, [], []
    for _ in range(ticks):
        seen.append(rows)
        actions, state = decider.predict(transform(rows), state)
        stated.append(actions)
        rows, *_ = env.step(actions)
    return np.array(stated), np.array(seen)


@pytest.mark.parametrize("radii", [(5.0,), (2.0, 5.0)])
def test_one_tick_at_a_time_equals_all_at_once(radii):
    options = QuickestOptions(radii=radii, ticks=80)
    net = random_net()
    decider = StatementDecider(net, options)
    inputs, log_probability, true_modes = simulate(options, TRACKS, 5)
    with torch.no_grad():
        outputs = net(torch.from_numpy(inputs), torch.from_numpy(log_probability))
    utility, stay = outputs.utility.numpy(), outputs.stay.numpy()
    stated = utility[0].argmax(-1)
    recorded = record_statements(decider, TRACKS, 5, **vars(options))
    np.testing.assert_array_equal(recorded.true_modes, true_modes)
    np.testing.assert_array_equal(recorded.stated_modes[0], stated)
    for tick in range(1, 80):
        utility[tick, np.arange(TRACKS), stated] += stay[tick]
        stated = utility[tick].argmax(-1)
        np.testing.assert_array_equal(recorded.stated_modes[tick], stated)


@pytest.mark.parametrize("radii", [(5.0,), (2.0, 5.0)])
def test_mirrored_rows_give_the_mirrored_statements(radii):
    options = QuickestOptions(radii=radii)
    layout = QuickestLayout(options.hypotheses)
    M, n = layout.hypotheses, len(radii)
    order = np.array([0, *range(n + 1, M), *range(1, n + 1)])
    decider = StatementDecider(random_net(), options)
    stated, rows = statements_of(decider, options)
    assert len(np.unique(stated)) == M
    state = None
    for tick, row in enumerate(rows):
        mirrored = row.copy()
        for name in layout.hypothesis_features:
            mirrored[:, layout.slices[name]] = row[:, layout.slices[name]][:, order]
        mirrored[:, layout.slices["innovation_across"]] *= -1.0
        actions, state = decider.predict(mirrored, state)
        np.testing.assert_array_equal(order[actions], stated[tick])


@pytest.mark.parametrize(("length", "time"), [(1000.0, 1.0), (0.3048, 60.0), (1.0, 0.001)])
def test_a_change_of_units_changes_no_statement(length, time):
    """The same rows as an environment in other units would give: only the speed has a unit."""
    options = QuickestOptions()
    other = QuickestOptions(
        speed=2.0 * length / time, tau=0.1 * time, radii=(5.0 * length,),
        measurement_variance=0.1 * length**2, process_variance=0.001 * length**2 / time**2,
        initial_error=(0.03 * length**2, 0.02 * length**2 / time**2),
    )  # fmt: skip
    net = random_net()
    stated, rows = statements_of(StatementDecider(net, options), options)
    scaled = rows.copy()
    scaled[..., QuickestLayout(3).slices["speed"]] *= length / time
    ages = np.ones(rows.shape[:2], np.int64)
    inputs = [statement_inputs(world, seen, ages) for world, seen in ((options, rows), (other, scaled))]
    assert inputs[0].shape[-1] == INPUTS
    np.testing.assert_allclose(*inputs, atol=1e-5)
    decider, state = StatementDecider(net, other), None
    changed = 0
    for tick, row in enumerate(scaled):
        actions, state = decider.predict(row, state)
        changed += int((actions != stated[tick]).sum())
    assert changed <= 1  # a tie within rounding


def test_an_episode_that_begins_is_not_remembered():
    options = QuickestOptions()
    decider = StatementDecider(random_net(), options)
    _, rows = statements_of(decider, options, ticks=40)
    _, state = decider.predict(rows[30])
    start = np.arange(TRACKS) % 2 == 0
    fresh, _ = decider.predict(rows[5])
    again, after = decider.predict(rows[5], state, start)
    np.testing.assert_array_equal(again[start], fresh[start])
    assert (after.age[start] == 1).all()


def test_invalid_arguments_are_refused():
    options = QuickestOptions()
    with pytest.raises(ValueError, match="margin="):
        StatementDecider(random_net(), options, float("nan"))
    with pytest.raises(ValueError, match="observation shape"):
        StatementDecider(random_net(), options).predict(np.zeros((3, 7), np.float32))


@pytest.mark.parametrize(
    "options",
    [
        {"speed": 1.4, "radii": (3.0,), "tau": 0.5, "measurement_variance": 4.0},  # a walker
        {"speed": 20.0, "radii": (200.0,), "tau": 1.0, "measurement_variance": 4.0},  # a car
        {"speed": 8.0, "radii": (800.0,), "tau": 10.0, "measurement_variance": 400.0},  # a ship
        {"speed": 250.0, "radii": (5000.0,), "tau": 1.0, "measurement_variance": 100.0},  # an aircraft
    ],
)
def test_an_untrained_network_is_the_threshold_rule_at_any_scale(options):
    world = QuickestOptions(**options)
    margin = -float(np.log1p(np.exp(2.0)))  # no utility of keeping the statement
    agent = record_statements(StatementDecider(StatementNet(4), world, margin), 20, 0, **options)
    rule = record_statements(ThresholdDecider(0.0), 20, 0, **options)
    assert (agent.stated_modes == rule.stated_modes).mean() > 0.999
