"""The agent that learns habits within the episode: invariances, one tick at a time, what its beam says."""

import numpy as np
import pytest
import torch

from agents.evaluation.worlds import RHYTHMS
from agents.learned.rhythm_decider import HABIT_INPUTS, RhythmDecider, habit_inputs, prior
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, QuickestOptions

TRACKS = 6


def random_decider(options, seed=0):
    """A decider whose outputs depend on all of its inputs."""
    torch.manual_seed(seed)
    net = RhythmDecider.network(8)
    torch.nn.init.normal_(net.output.weight, std=0.3)
    return RhythmDecider(net.eval(), options)


def observed(decider, options, ticks):
    """Observations (T, N, width), and statements (T, N)."""
    env = HybridTrackQuickestVectorEnv(TRACKS, **vars(options))
    env.reset(seed=3)
    state, seen, stated = None, [], []
    for _ in range(ticks):
        seen.append(decider.observe(env.world))
        actions, state = decider.predict(seen[-1], state)
        stated.append(actions)
        env.step(actions)
    return np.array(seen), np.array(stated)


def test_inputs_of_habits_are_sums_over_the_histories_of_the_beam():
    options = QuickestOptions(durations="uniform 20-30", ticks=120)
    decider = random_decider(options)
    seen, _ = observed(decider, options, 120)
    state = None
    for row in seen:
        _, state = decider.predict(row, state)
    branches, logs = state.filters.branches, state.filters.log_probability
    found = habit_inputs(branches, logs)
    assert found.shape == (TRACKS, 3, len(HABIT_INPUTS))
    for track in range(TRACKS):
        alive = slice(0, branches.counts[track])
        weights = np.exp(branches.filters[track]["log_likelihood"].ravel()[alive])
        for mode in range(3):
            of_mode = weights * (branches.modes[track, alive] == mode)
            age = of_mode @ branches.ages[track, alive] / np.exp(logs[track, mode])
            new = (of_mode * (branches.ages[track, alive] == 1)).sum()
            assert found[track, mode, 4] == pytest.approx(np.log(max(age, 1.0)) / 5.0, abs=1e-5)
            assert found[track, mode, 2] == pytest.approx(max(np.log(max(new, 1e-30)), -15.0) / 5.0, abs=1e-5)


def test_no_reported_rhythm_is_in_the_prior():
    laws = {str(law) for law in prior().laws}
    assert not laws & {world.get("durations", "") for world in RHYTHMS.values()}
    assert {"uniform 50-100", "25 + geometric 50"} < laws
    assert len(laws) < 100


def test_rows_alone_are_refused():
    options = QuickestOptions()
    with pytest.raises(ValueError, match="observation shape"):
        random_decider(options).predict(np.zeros((3, QuickestLayout(3).width), np.float32))
