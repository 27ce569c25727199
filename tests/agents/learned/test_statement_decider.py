"""The agents that state the present mode, from rows and from a beam: invariances, one tick at a
time.
"""

import numpy as np
import pytest
import torch
from other_units import in_other_units
from recorded_rollouts import recorded

from agents.learned.statement_decider import StatementDecider
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
    seen, stated, _ = recorded(env, decider, ticks)
    return stated, seen


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
