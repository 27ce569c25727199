"""The shipped agent decides on a live sensor as in the environment."""

import pytest
from agents.evaluation.deciders import load_decider
from online_episodes import COMMON, same_as_announced

from hybrid_env import WorldOptions


@pytest.mark.parametrize("correctness", ["exact", "type"])
@pytest.mark.parametrize("name", ["R 0.1", "axes", "walker"])
def test_the_shipped_agent_equals_itself_in_the_environment(name, correctness):
    options = {"correctness": correctness, **COMMON[name]}
    decided = same_as_announced(load_decider("shipped:0.03", WorldOptions(**options)), seed=6, **options)
    assert not all(forced for _, forced in decided)
