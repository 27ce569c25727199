"""The agents that state the present mode, from rows and from a beam: invariances, one tick at a
time.
"""

import numpy as np
import pytest
import torch

from agents.algorithms.statements import simulate
from agents.learned.rhythm_decider import RhythmDecider
from agents.learned.statement_decider import StatementDecider
from agents.learned.statement_net import StatementNet
from baselines import ThresholdDecider, record_statements
from baselines.rules.measurements import OBSERVED
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, QuickestOptions

KINDS = pytest.mark.parametrize("kind", [StatementDecider, RhythmDecider])
TRACKS = 8
# Columns of measurement, estimate and covariance that change sign with y.
ODD = [1, 4, 5, 8, 9, 11, 12]


def random_decider(kind, options):
    """A decider whose outputs depend on all of its inputs."""
    torch.manual_seed(0)
    net = kind.network(8)
    torch.nn.init.normal_(net.output.weight, std=0.4)
    return kind(net.eval(), options)


def statements_of(decider, options, ticks=150):
    """Statements (T, N) of a decider, and what it observes (T, N, width)."""
    env = HybridTrackQuickestVectorEnv(TRACKS, **vars(options))
    env.reset(seed=3)
    state = None
    stated = []
    seen = []
    for _ in range(ticks):
        seen.append(decider.observe(env.world).copy())
        actions, state = decider.predict(seen[-1], state)
        stated.append(actions)
        env.step(actions)
    return np.array(stated), np.array(seen)


def stated_again(decider, seen):
    """Statements (T, N) for given observations."""
    state = None
    stated = []
    for rows in seen:
        actions, state = decider.predict(rows, state)
        stated.append(actions)
    return np.array(stated)


@KINDS
@pytest.mark.parametrize(
    "more",
    [
        {},
        {
            "radii": (2.0, 5.0),
            "durations": "drawn",
            "order": "drawn",
        },
    ],
)
def test_one_tick_at_a_time_equals_all_at_once(kind, more):
    options = QuickestOptions(ticks=80, **more)
    decider = random_decider(kind, options)
    inputs, log_probability, true_modes = simulate(options, TRACKS, 5, decider)
    with torch.no_grad():
        outputs = decider.net(torch.from_numpy(inputs), torch.from_numpy(log_probability))
    utility, stay = outputs.utility.numpy(), outputs.stay.numpy()
    stated = utility[0].argmax(-1)
    recorded = record_statements(decider, TRACKS, 5, **vars(options))

    np.testing.assert_array_equal(recorded.true_modes, true_modes)
    np.testing.assert_array_equal(recorded.stated_modes[0], stated)
    for tick in range(1, 80):
        utility[tick, np.arange(TRACKS), stated] += stay[tick]
        stated = utility[tick].argmax(-1)
        np.testing.assert_array_equal(recorded.stated_modes[tick], stated)


@KINDS
def test_a_mirrored_trajectory_has_the_mirrored_statements(kind):
    options = QuickestOptions(radii=(2.0, 5.0), ticks=150)
    layout = QuickestLayout(5)
    order = np.array([0, 3, 4, 1, 2])
    decider = random_decider(kind, options)
    stated, seen = statements_of(decider, options)

    assert len(np.unique(stated)) == 5
    mirrored = seen.copy()
    for name in layout.hypothesis_features:
        mirrored[..., layout.slices[name]] = seen[..., layout.slices[name]][..., order]
    mirrored[..., layout.slices["innovation_across"]] *= -1.0
    if kind is RhythmDecider:
        turns = mirrored[..., layout.width :]
        turns[..., ODD] *= -1.0
        turns[..., OBSERVED:] = turns[..., OBSERVED:][..., order]
    # A tie within rounding.
    assert (order[stated_again(decider, mirrored)] != stated).sum() <= 1


@KINDS
@pytest.mark.parametrize(("length", "time"), [(0.3048, 60.0)])
def test_a_change_of_units_changes_no_statement(kind, length, time):
    """What would be observed in other units: of the rows only the speed has one."""
    options = QuickestOptions(ticks=150)
    layout = QuickestLayout(3)
    other = QuickestOptions(
        speed=2.0 * length / time,
        tau=0.1 * time,
        radii=(5.0 * length,),
        ticks=150,
        measurement_variance=0.1 * length**2,
        process_variance=0.001 * length**2 / time**2,
        initial_error=(0.03 * length**2, 0.02 * length**2 / time**2),
    )
    stated, seen = statements_of(random_decider(kind, options), options)
    scaled = seen.copy()
    scaled[..., layout.slices["speed"]] *= length / time
    if kind is RhythmDecider:
        turns = scaled[..., layout.width :]
        units = np.array([length, length / time] * 2)
        turns[..., :2] *= length
        turns[..., 2:6] *= units
        turns[..., 6:16] *= np.outer(units, units)[np.triu_indices(4)]
    # A tie within rounding.
    assert (stated_again(random_decider(kind, other), scaled) != stated).sum() <= 1


def test_an_episode_that_begins_is_not_remembered():
    options = QuickestOptions()
    decider = random_decider(StatementDecider, options)
    _, rows = statements_of(decider, options, ticks=40)
    _, state = decider.predict(rows[30])
    start = np.arange(TRACKS) % 2 == 0
    fresh, _ = decider.predict(rows[5])
    again, after = decider.predict(rows[5], state, start)

    np.testing.assert_array_equal(again[start], fresh[start])
    assert (after.age[start] == 1).all()


@pytest.mark.parametrize(
    "options",
    [
        # A walker.
        {
            "speed": 1.4,
            "radii": (3.0,),
            "tau": 0.5,
            "measurement_variance": 4.0,
        },
        # An aircraft.
        {
            "speed": 250.0,
            "radii": (5000.0,),
            "tau": 1.0,
            "measurement_variance": 100.0,
        },
    ],
)
def test_an_untrained_network_is_the_threshold_rule_at_any_scale(options):
    world = QuickestOptions(**options)
    # No utility of keeping the statement.
    margin = -float(np.log1p(np.exp(2.0)))
    agent = record_statements(StatementDecider(StatementNet(4), world, margin), 20, 0, **options)
    rule = record_statements(ThresholdDecider(0.0), 20, 0, **options)

    assert (agent.stated_modes == rule.stated_modes).mean() > 0.999
