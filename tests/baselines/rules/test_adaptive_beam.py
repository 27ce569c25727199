"""The adaptive beam weights laws by their evidence, shares filters among them, and learns the
order.
"""

import numpy as np

from baselines.rules.beam import BeamDecider
from baselines.rules.beam_prior import Prior, mixed_prior
from hybrid_env import HybridTrackQuickestVectorEnv
from hybrid_env.durations import parse_durations
from studies.shifts.worlds import RHYTHMS


def states_of(env, deciders, ticks):
    """Yield the states of deciders on the same tracks, after every tick."""
    env.reset(seed=3)
    states = [None] * len(deciders)
    for _ in range(ticks):
        seen = deciders[0].observe(env.world)
        # The first mode is known, so that nothing is merged before the second switch.
        seen[:, 16:] = np.where(seen[:, 16:] == seen[:, 16:].max(1, keepdims=True), 0.0, -600.0)
        states = [
            decider.predict(seen, state)[1] for decider, state in zip(deciders, states, strict=True)
        ]
        yield states
        env.step(np.zeros(env.num_envs, np.int64))


def test_the_posterior_of_the_laws_follows_from_the_normalising_constants_of_their_beams():
    env = HybridTrackQuickestVectorEnv(6, durations="uniform 8-9", ticks=15)
    texts = ("uniform 8-11", "uniform 9-13", "7 + geometric 4")
    prior = np.array([0.5, 0.2, 0.3])
    adaptive = BeamDecider(
        env.options,
        branches=200,
        prior=Prior(tuple(map(parse_durations, texts)), tuple(prior), different=0.0),
    )
    beams = [BeamDecider(env.options, branches=200, durations=text) for text in texts]
    *_, (learned, *known) = states_of(env, [adaptive, *beams], 15)
    weights = prior * np.exp(np.transpose([state.branches.evidence for state in known]))
    expected = np.log(weights.sum(1)), weights / weights.sum(1, keepdims=True)
    branches = learned.branches
    shares = np.exp(branches.filters["log_likelihood"].reshape(6, -1))
    beliefs = np.zeros((6, 3))
    for i in range(6):
        for b in range(branches.counts[i]):
            # When the segment began.
            history = branches.histories[i, b]
            belief = branches.habits.laws[i, history["slot"], 0]
            belief = belief * adaptive.model.tables[history["row"], history["age"] - 1, 0]
            beliefs[i] += shares[i, b] * belief / belief.sum()

    np.testing.assert_allclose(branches.evidence, expected[0], atol=1e-4)
    np.testing.assert_allclose(beliefs, expected[1], atol=1e-4)
    probabilities = np.array([np.exp(state.log_probability) for state in known])
    mixture = np.einsum("il,lim->im", expected[1], probabilities)
    np.testing.assert_allclose(np.exp(learned.log_probability), mixture, atol=1e-4)


def test_a_cycle_is_learned():
    env = HybridTrackQuickestVectorEnv(
        8, durations="uniform 40-50", transitions="cycle", ticks=900, measurement_variance=0.01
    )
    decider = BeamDecider(env.options, prior=mixed_prior())
    *_, (state,) = states_of(env, [decider], 900)
    branches = state.branches
    for track in range(8):
        best = branches.filters[track]["log_likelihood"].ravel()[: branches.counts[track]].argmax()
        slot = branches.histories[track, best]["slot"]
        counts = branches.habits.orders[track, slot]
        assert branches.habits.habitual[track, slot] > 0.99
        np.testing.assert_array_equal(counts.argmax(1), [1, 2, 0])
        assert (counts.max(1) > 0.9 * counts.sum(1)).all()
        assert 12 < counts.sum() < 24


def test_no_reported_rhythm_is_in_the_prior():
    laws = {str(law) for law in mixed_prior().laws}
    fixed = {world.get("durations", "") for world in RHYTHMS.values()}

    assert len(RHYTHMS) == 13
    assert not laws & fixed
