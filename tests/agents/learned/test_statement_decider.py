"""The agents that state the present mode, from rows and from a beam: invariances, one tick at a
time.
"""

import numpy as np
import pytest
import torch
from other_units import in_other_units

from agents.learned.statement_decider import StatementDecider, habit_inputs
from agents.learned.statement_net import StatementNet
from baselines import ThresholdDecider, record_statements, rollout
from baselines.rules.measurements import OBSERVED
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, QuickestOptions

HABITS = pytest.mark.parametrize("habits", [False, True])
TRACKS = 8
# Columns of measurement, estimate and covariance that change sign with y.
ODD = [1, 4, 5, 8, 9, 11, 12]


def random_decider(habits, options):
    """A decider whose outputs depend on all of its inputs."""
    torch.manual_seed(0)
    net = StatementDecider.network(8, habits)
    torch.nn.init.normal_(net.output.weight, std=0.4)
    return StatementDecider(net.eval(), options)


def statements_of(decider, options, ticks=150):
    """Statements (T, N) of a decider, and what it observes (T, N, width)."""
    env = HybridTrackQuickestVectorEnv(TRACKS, **vars(options))
    stated, seen = [], []
    for now in rollout(env, decider, 3):
        if now.step:
            stated.append(now.actions)
        if now.step == ticks:
            return np.array(stated), np.array(seen)
        seen.append(now.seen.copy())


def stated_again(decider, seen):
    """Statements (T, N) for given observations."""
    state = None
    stated = []
    for rows in seen:
        actions, state = decider.predict(rows, state)
        stated.append(actions)
    return np.array(stated)


@HABITS
def test_a_mirrored_trajectory_has_the_mirrored_statements(habits):
    options = QuickestOptions(radii=(2.0, 5.0), ticks=150)
    layout = QuickestLayout(5)
    order = np.array([0, 3, 4, 1, 2])
    decider = random_decider(habits, options)
    stated, seen = statements_of(decider, options)

    assert len(np.unique(stated)) == 5
    mirrored = seen.copy()
    for name in layout.hypothesis_features:
        mirrored[..., layout.slices[name]] = seen[..., layout.slices[name]][..., order]
    mirrored[..., layout.slices["innovation_across"]] *= -1.0
    if habits:
        turns = mirrored[..., layout.width :]
        turns[..., ODD] *= -1.0
        turns[..., OBSERVED:] = turns[..., OBSERVED:][..., order]
    # A tie within rounding.
    assert (order[stated_again(decider, mirrored)] != stated).sum() <= 1


@HABITS
def test_a_change_of_units_changes_no_statement(habits):
    """What would be observed in other units: rows have none, what the beam observes has."""
    length, time = 0.3048, 60.0
    options = QuickestOptions(ticks=150)
    other = in_other_units(options, length, time)
    stated, seen = statements_of(random_decider(habits, options), options)
    scaled = seen.copy()
    if habits:
        turns = scaled[..., QuickestLayout(3).width :]
        units = np.array([length, length / time] * 2)
        turns[..., :2] *= length
        turns[..., 2:6] *= units
        turns[..., 6:16] *= np.outer(units, units)[np.triu_indices(4)]
    # A tie within rounding.
    assert (stated_again(random_decider(habits, other), scaled) != stated).sum() <= 1


def test_an_untrained_network_is_the_threshold_rule():
    # No utility of keeping the statement.
    margin = -float(np.log1p(np.exp(2.0)))
    decider = StatementDecider(StatementNet(4, 26), QuickestOptions()).at(margin)
    agent, rule = (record_statements(each, 20, 0) for each in (decider, ThresholdDecider(0.0)))

    assert (agent.stated_modes == rule.stated_modes).mean() > 0.999


def test_inputs_of_habits_are_sums_over_the_histories_of_the_beam():
    options = QuickestOptions(durations="uniform 10-15", ticks=60)
    env = HybridTrackQuickestVectorEnv(TRACKS, **vars(options))
    decider = random_decider(True, options)
    for now in rollout(env, decider, 3):
        if now.step == 60:
            break
    branches, logs = now.state.beam.branches, now.state.beam.log_probability
    inputs = habit_inputs(branches, logs)

    for track in range(TRACKS):
        alive = slice(0, branches.counts[track])
        weights = np.exp(branches.filters[track]["log_likelihood"].ravel()[alive])
        for mode in range(3):
            of_mode = weights * (branches.histories["mode"][track, alive] == mode)
            age = of_mode @ branches.histories["age"][track, alive] / np.exp(logs[track, mode])
            assert inputs[track, mode, 4] == pytest.approx(np.log(max(age, 1.0)) / 5.0, abs=1e-5)
