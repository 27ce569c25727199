"""The agent for recorded flights: what it states, and its mirror image."""

import numpy as np
import pytest

from agents.evaluation.registry import learned_family, policy_folder
from agents.learned.flight_decider import FlightAgent, flight_inputs
from baselines.estimation.turns import run_turn_imm
from baselines.recordings.flights.flight import TIERS, stack_flights
from baselines.recordings.flights.simulated import simulate_flights
from baselines.recordings.flights.tracks import FlightTracks
from baselines.rules.decider import FLIGHTS


@pytest.fixture(scope="module")
def batch():
    return stack_flights(simulate_flights(TIERS["B"], 2, 700.0, np.random.default_rng(5))[0])


def statements(agent, batch):
    """Statements (T, B) at all positions."""
    tracks = FlightTracks(batch, run_turn_imm(batch))
    observation = tracks.reset()[0]
    state = None
    stated = []
    for _ in batch.times:
        observation = agent.observe(tracks)
        actions, state = agent.predict(observation, state)
        stated.append(actions)
        tracks.step(actions)
    return np.array(stated)


def test_an_untrained_agent_without_stay_states_the_most_probable_mode(batch):
    agent = FlightAgent(
        FlightAgent.network(4),
        margin=-float(np.log1p(np.exp(2.0))),
    )
    probable = run_turn_imm(batch).probabilities.argmax(-1)

    assert (statements(agent, batch) == probable)[1:].all()


def test_a_mirrored_flight_gives_mirrored_statements(batch):
    mirrored = batch._replace(positions=batch.positions * [1.0, -1.0])
    inputs = flight_inputs(batch, run_turn_imm(batch))
    other = flight_inputs(mirrored, run_turn_imm(mirrored))

    np.testing.assert_allclose(inputs[:, :, ::-1], other, atol=1e-3)
    agent = learned_family(policy_folder("shipped", FLIGHTS)).make(0.0)
    one, two = (statements(agent, some) for some in (batch, mirrored))
    # Ties of rounding errors.
    assert ((np.array([0, 2, 1])[one] == two).mean()) > 0.99
