"""Training of the agent for flights."""

import json
from pathlib import Path

import torch
from agents.training.flights import FlightTraining

from agents.learned.flight_decider import load_flight_agent


def train(folder: Path, seed: int, passes: int = 1) -> tuple[dict[str, torch.Tensor], float]:
    """Return the saved weights, and the mean reward of all passes over the flights of the only round."""
    notes: list[str] = []
    training = FlightTraining(
        out=folder, rounds=1, passes=passes, flights=(3, 3, 3, 1), rows=200, n_steps=50, hidden=8, seed=seed
    )
    net = training.run(notes.append)
    saved = load_flight_agent(folder).state_dict()
    for name, weights in net.state_dict().items():
        torch.testing.assert_close(saved[name], weights, rtol=0, atol=0)
    return saved, float(notes[-1].split("expected reward ")[1].split(",")[0])


def test_equal_seeds_give_equal_weights(tmp_path):
    weights, _ = train(tmp_path / "one", 0)
    again, _ = train(tmp_path / "two", 0)
    other, _ = train(tmp_path / "three", 1)
    assert all(torch.equal(weights[name], again[name]) for name in weights)
    assert not all(torch.equal(weights[name], other[name]) for name in weights)
    card = json.loads(next((tmp_path / "one").glob("*.json")).read_text())
    assert card["rounds"] == 1
    assert card["settings"]["seed"] == 0


def test_more_passes_over_the_same_flights_increase_the_reward(tmp_path):
    (_, first), (_, mean) = train(tmp_path / "one", 0), train(tmp_path / "twenty", 0, 20)
    assert mean > first
