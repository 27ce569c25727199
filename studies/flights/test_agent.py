"""The agent for recorded flights: what it states, and its mirror image."""

import numpy as np
import pytest

from studies.flights.agent import FlightAgent, flight_inputs
from studies.flights.flight import TIERS, stack_flights
from studies.flights.simulated import simulate_flights
from studies.flights.study import SHIPPED
from studies.flights.tracks import FlightTracks
from studies.flights.turns import run_turn_imm


@pytest.fixture(scope="module")
def batch():
    return stack_flights(simulate_flights(TIERS["B"], 2, 700.0, np.random.default_rng(5))[0])


def statements(agent, batch):
    return agent.statements(FlightTracks(batch, run_turn_imm(batch)))[..., 0]


def test_an_untrained_agent_without_stay_states_the_most_probable_mode(batch):
    agent = FlightAgent(
        FlightAgent.network(4),
        -float(np.log1p(np.exp(2.0))),
    )
    probable = run_turn_imm(batch).probabilities.argmax(-1)

    assert (statements(agent, batch) == probable)[1:].all()


def test_a_mirrored_flight_gives_mirrored_statements(batch):
    mirrored = batch._replace(positions=batch.positions * [1.0, -1.0])
    inputs = flight_inputs(batch, run_turn_imm(batch))
    other = flight_inputs(mirrored, run_turn_imm(mirrored))

    np.testing.assert_allclose(
        inputs[:, :, ::-1],
        other,
        atol=1e-3,
    )
    agent = FlightAgent.read(SHIPPED)()
    one, two = (statements(agent, some) for some in (batch, mirrored))
    # Ties of rounding errors.
    assert ((np.array([0, 2, 1])[one] == two).mean()) > 0.99
