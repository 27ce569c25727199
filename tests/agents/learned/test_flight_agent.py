import numpy as np
import pytest
import torch

from agents.learned.flight_decider import (
    FlightAgent,
    load_flight_agent,
    save_flight_agent,
    shipped_flight_decider,
)
from agents.learned.flight_inputs import INPUTS, flight_inputs
from agents.learned.statement_net import StatementNet
from baselines.estimation.turn_imm import run_turn_imm
from baselines.recordings.flights.flight import stack_flights
from baselines.recordings.flights.simulated import simulate_flights
from baselines.recordings.flights.tiers import TIERS
from hybrid_env.checks import ArgumentError


@pytest.fixture(scope="module")
def batch():
    return stack_flights(simulate_flights(TIERS["B"], 2, 700.0, np.random.default_rng(5))[0])


def test_an_untrained_agent_without_stay_states_the_most_probable_mode(batch):
    estimates = run_turn_imm(batch)
    agent = FlightAgent(StatementNet(4, INPUTS), margin=-float(np.log1p(np.exp(2.0))))
    stated = agent.state_modes(batch, estimates)
    assert (stated == estimates.probabilities.argmax(-1))[1:].all()


def test_a_mirrored_flight_gives_mirrored_statements(batch):
    mirrored = batch._replace(positions=batch.positions * [1.0, -1.0])
    inputs = flight_inputs(batch, run_turn_imm(batch))
    other = flight_inputs(mirrored, run_turn_imm(mirrored))
    np.testing.assert_allclose(inputs[:, :, ::-1], other, atol=1e-3)
    agent = shipped_flight_decider()
    one, two = (agent.state_modes(some, run_turn_imm(some)) for some in (batch, mirrored))
    assert ((np.array([0, 2, 1])[one] == two).mean()) > 0.99  # ties of rounding errors


def test_weights_are_saved_and_loaded(tmp_path):
    net = StatementNet(4, INPUTS)
    save_flight_agent(tmp_path, net, {"settings": {"hidden": 4}})
    loaded = load_flight_agent(tmp_path)
    assert all(
        torch.equal(a, b)
        for a, b in zip(net.state_dict().values(), loaded.state_dict().values(), strict=True)
    )
    (tmp_path / "policy.safetensors").write_bytes(b"no")
    with pytest.raises(ArgumentError, match="run="):
        load_flight_agent(tmp_path)
