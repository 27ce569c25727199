"""The agent that learns habits within the episode: invariances, one tick at a time, what its beam says."""

import numpy as np
import pytest
import torch

from agents.evaluation.worlds import RHYTHMS
from agents.learned.rhythm_decider import HABIT_INPUTS, RhythmDecider, habit_inputs, prior
from agents.training.statements import simulate
from baselines import record_statements
from baselines.rules.measurements import OBSERVED
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, QuickestOptions

TRACKS = 6
ODD = [1, 4, 5, 8, 9, 11, 12]  # columns of measurement, estimate and covariance that change sign with y


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


@pytest.mark.parametrize("radii", [(5.0,), (2.0, 5.0)])
def test_one_tick_at_a_time_equals_all_at_once(radii):
    options = QuickestOptions(radii=radii, ticks=80, durations="drawn", order="drawn")
    decider = random_decider(options)
    inputs, log_probability, true_modes = simulate(options, TRACKS, 5, decider)
    assert inputs.shape == (80, TRACKS, options.hypotheses - 1, RhythmDecider.inputs)
    with torch.no_grad():
        outputs = decider.net(torch.from_numpy(inputs), torch.from_numpy(log_probability))
    utility, stay = outputs.utility.numpy(), outputs.stay.numpy()
    recorded = record_statements(decider, TRACKS, 5, **vars(options))
    np.testing.assert_array_equal(recorded.true_modes, true_modes)
    stated = utility[0].argmax(-1)
    for tick in range(1, 80):
        utility[tick, np.arange(TRACKS), stated] += stay[tick]
        stated = utility[tick].argmax(-1)
        np.testing.assert_array_equal(recorded.stated_modes[tick], stated)


def test_a_mirrored_trajectory_has_the_mirrored_statements():
    options = QuickestOptions(radii=(2.0, 5.0), ticks=150)
    layout, order = QuickestLayout(5), np.array([0, 3, 4, 1, 2])
    decider = random_decider(options)
    seen, stated = observed(decider, options, 150)
    assert len(np.unique(stated)) == 5
    state, changed = None, 0
    for tick, row in enumerate(seen):
        mirrored = row.copy()
        for name in layout.hypothesis_features:
            mirrored[:, layout.slices[name]] = row[:, layout.slices[name]][:, order]
        mirrored[:, layout.slices["innovation_across"]] *= -1.0
        own = mirrored[:, layout.width :]
        own[:, ODD] *= -1.0
        own[:, OBSERVED:] = own[:, OBSERVED:][:, order]
        actions, state = decider.predict(mirrored, state)
        changed += int((order[actions] != stated[tick]).sum())
    assert changed <= 1  # a tie within rounding


@pytest.mark.parametrize(("length", "time"), [(1000.0, 1.0), (0.3048, 60.0)])
def test_a_change_of_units_changes_no_statement(length, time):
    options = QuickestOptions(ticks=150)
    other = QuickestOptions(
        speed=2.0 * length / time, tau=0.1 * time, radii=(5.0 * length,), ticks=150,
        measurement_variance=0.1 * length**2, process_variance=0.001 * length**2 / time**2,
        initial_error=(0.03 * length**2, 0.02 * length**2 / time**2),
    )  # fmt: skip
    seen, stated = observed(random_decider(options), options, 150)
    scaled, width = seen.copy(), QuickestLayout(3).width
    scaled[..., QuickestLayout(3).slices["speed"]] *= length / time
    units = np.array([length, length / time] * 2)
    scaled[..., width : width + 2] *= length
    scaled[..., width + 2 : width + 6] *= units
    scaled[..., width + 6 : width + 16] *= np.outer(units, units)[np.triu_indices(4)]
    decider, state, changed = random_decider(other), None, 0
    for tick, row in enumerate(scaled):
        actions, state = decider.predict(row, state)
        changed += int((actions != stated[tick]).sum())
    assert changed <= 1  # a tie within rounding


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
