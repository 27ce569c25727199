"""The agent that learns habits within the episode: what its beam says, and its prior."""

import numpy as np
import pytest

from agents.evaluation.worlds import RHYTHMS
from agents.learned.rhythm_decider import HABIT_INPUTS, PRIOR, RhythmDecider, habit_inputs
from hybrid_env import HybridTrackQuickestVectorEnv

TRACKS = 6


def test_inputs_of_habits_are_sums_over_the_histories_of_the_beam():
    env = HybridTrackQuickestVectorEnv(TRACKS, durations="uniform 20-30", ticks=120)
    env.reset(seed=3)
    decider = RhythmDecider(RhythmDecider.network(8), env.options)
    state = None
    for _ in range(120):
        actions, state = decider.predict(decider.observe(env.world), state)
        env.step(actions)
    branches, logs = state.filters.branches, state.filters.log_probability
    inputs = habit_inputs(branches, logs)

    assert inputs.shape == (TRACKS, 3, len(HABIT_INPUTS))
    for track in range(TRACKS):
        alive = slice(0, branches.counts[track])
        weights = np.exp(branches.filters[track]["log_likelihood"].ravel()[alive])
        for mode in range(3):
            of_mode = weights * (branches.modes[track, alive] == mode)
            age = of_mode @ branches.ages[track, alive] / np.exp(logs[track, mode])
            new = (of_mode * (branches.ages[track, alive] == 1)).sum()
            assert inputs[track, mode, 4] == pytest.approx(np.log(max(age, 1.0)) / 5.0, abs=1e-5)
            assert inputs[track, mode, 2] == pytest.approx(
                max(np.log(max(new, 1e-30)), -15.0) / 5.0,
                abs=1e-5,
            )


def test_no_reported_rhythm_is_in_the_prior():
    laws = {str(law) for law in PRIOR.laws}
    assert not laws & {world.get("durations", "") for world in RHYTHMS.values()}
    assert {"uniform 50-100", "25 + geometric 50"} < laws
    assert len(laws) < 100
