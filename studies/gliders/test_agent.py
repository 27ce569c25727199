"""The agent for gliders: trained on simulated flights, loaded, and at several settings together."""

import numpy as np
import pytest

from agents import train
from studies.flights.metrics import STATISTICS, score_flights
from studies.gliders.simulated import label_gliders, simulate_glider
from studies.gliders.study import HERE, Setting, glider_statements
from studies.gliders.training import Gliders

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
        train(
            str(HERE / "gliders.yml"),
            out=folder,
            steps=30_000,
            changes=SMALL,
        )
    return folder


def test_a_short_training_states_most_modes(flights, folder):
    settings = [Setting(str(folder), 0, pair) for pair in ((0.0, 0.0), (3.0, 3.0))]
    stated = glider_statements(flights, settings)
    labels = label_gliders(flights)
    scores = [score_flights("agent", flights, labels, modes) for modes in stated.values()]
    agreement, false = (
        [float(one.curve(STATISTICS[name])[0]) for one in scores]
        for name in ("agreement", "false_per_hour")
    )

    assert agreement[0] > 0.85
    assert false[1] < false[0]
    alone = glider_statements(flights, settings[1:])[settings[1]]
    for one, other in zip(alone, stated[settings[1]], strict=True):
        np.testing.assert_array_equal(one, other)
