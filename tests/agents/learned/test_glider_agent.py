"""The agent for gliders: trained on simulated flights, loaded, at several settings together, and
mirrored.
"""

import numpy as np
import pytest

from agents.algorithms.gliders import Gliders
from agents.evaluation.gliders import Setting, glider_rule, glider_statements
from agents.evaluation.registry import learned_family
from agents.learned.glider_decider import GliderAgent
from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from baselines.estimation.turns import run_turn_imm
from baselines.recordings.flights.flight import stack_flights
from baselines.recordings.flights.metrics import STATISTICS, score_flights
from baselines.recordings.flights.simulated_gliders import label_gliders, simulate_glider
from hybrid_env.checks import ArgumentError

SMALL = ("flights=[8]", "rows=300", "passes=2", "n_steps=100", "hidden=6", "learning_rate=0.02")


@pytest.fixture(scope="module")
def flights():
    generator = np.random.default_rng(3)
    return [simulate_glider(1500.0, generator) for _ in range(6)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "mine"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Gliders, "curve_flights", (2,))
        env = "hybrid_env:HybridTrack-v0"
        make_run(env, {}, load_recipe("gliders", env, SMALL), 0, folder, 30_000).train()
    return folder


def test_a_short_training_states_most_modes(flights, folder):
    settings = [Setting(str(folder), 0, pair) for pair in ((0.0, 0.0), (3.0, 3.0))]
    found = glider_statements(flights, settings)
    scores = [
        score_flights("agent", flights, label_gliders(flights), one) for one in found.values()
    ]
    agreement, false = (
        [float(one.curve(STATISTICS[name])[0]) for one in scores]
        for name in ("agreement", "false_per_hour")
    )

    assert agreement[0] > 0.85
    assert false[1] < false[0]
    alone = glider_statements(flights, settings[1:])[settings[1]]
    for one, other in zip(alone, found[settings[1]], strict=True):
        np.testing.assert_array_equal(one, other)


def test_an_agent_for_gliders_is_no_agent_for_aircraft(folder):
    with pytest.raises(ArgumentError, match="a policy for recorded flights"):
        learned_family(folder)
    with pytest.raises(ArgumentError, match="agent with --gliders, or the folder of an agent"):
        glider_rule("runs/none")


def test_inputs_of_a_mirrored_flight_are_mirrored(flights):
    batch = stack_flights(flights[:2])
    mirrored = batch._replace(positions=batch.positions * [1.0, -1.0])
    one, other = (
        GliderAgent.inputs_of(some, run_turn_imm(some, GliderAgent.model))
        for some in (batch, mirrored)
    )

    np.testing.assert_allclose(one[:, :, ::-1], other, atol=2e-3)
    assert one.shape[-1] == GliderAgent.inputs
