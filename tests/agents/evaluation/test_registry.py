"""The contract of every decider that is found by its name, for both kinds of switches."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
from recorded_rollouts import recorded

from agents.evaluation.registry import find_decider, policy_folder, shipped_names
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from baselines.rules.rollout import rollout
from hybrid_env import (
    ArgumentError,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    WorldOptions,
)
from hybrid_env.quickest_options import QuickestOptions

OPTIONS = {
    ANNOUNCED: WorldOptions(scheme="random 2x20-25"),
    UNKNOWN: QuickestOptions(ticks=40, durations="uniform 10-20"),
}
KINDS = {ANNOUNCED: HybridTrackVectorEnv, UNKNOWN: HybridTrackQuickestVectorEnv}
EVERY = [
    (task, name) for task in OPTIONS for name in dict.fromkeys((*rules(task), *shipped_names(task)))
]
TRACKS, STEPS = 4, 60


def environment(task, decider, tracks):
    options = vars(OPTIONS[task]) | dict(decider.options)
    return KINDS[task](tracks, autoreset_mode="SameStep", tick_info=False, **options)


def played(task, decider, tracks=TRACKS, seed=5):
    """Return the actions (STEPS, N), which begin a second episode."""
    return recorded(environment(task, decider, tracks), decider, STEPS, seed)[1]


@pytest.mark.parametrize(("task", "name"), EVERY)
def test_every_decider_decides_the_same_in_a_copy_and_for_each_track_alone(task, name):
    decider = find_decider(name, OPTIONS[task])
    actions = played(task, decider)

    largest = OPTIONS[task].hypotheses - (task == UNKNOWN)
    assert ((actions >= 0) & (actions <= largest)).all()
    np.testing.assert_array_equal(played(task, pickle.loads(pickle.dumps(decider))), actions)
    for track in (0, TRACKS - 1):
        alone = played(task, decider, 1, 5 + track)
        np.testing.assert_array_equal(alone[:, 0], actions[:, track])


@pytest.mark.parametrize(("task", "name"), EVERY)
def test_every_decider_is_found_at_its_thresholds_and_can_drop_tracks(task, name):
    decider = find_decider(name, OPTIONS[task])
    assert decider.threshold == decider.default in decider.thresholds
    first, last = decider.thresholds[0], decider.thresholds[-1]
    if first != last:
        assert find_decider(f"{name}:{last:.17g}", OPTIONS[task]).threshold == last
        assert (played(task, decider.at(first)) != played(task, decider.at(last))).any()
    env = environment(task, decider, TRACKS)
    kept = np.arange(TRACKS) % 2 == 0
    for now in rollout(env, decider, 5):
        if now.step == 10:
            state = decider.select_tracks(pickle.loads(pickle.dumps(now.state)), kept)
            if state is not NotImplemented:
                every = decider.predict(now.seen, now.state, now.starts)[0]
                some = decider.predict(now.seen[kept], state, now.starts[kept])[0]
                np.testing.assert_array_equal(some, every[kept])
            break


@pytest.mark.parametrize("task", OPTIONS)
def test_a_policy_for_the_other_kind_of_switches_is_refused(task):
    (other,) = set(OPTIONS) - {task}
    with pytest.raises(ArgumentError, match=f"a policy for {task} switches"):
        find_decider(str(policy_folder("shipped", other)), OPTIONS[task])


def test_a_wrong_name_is_refused_before_an_agent_is_loaded():
    """In a new process, where PyTorch would have to be imported."""
    code = (
        "import sys; from agents.cli import main;"
        " assert main(['compare', 'ate', 'shipped', 'aet']) == 2;"
        " assert main(['train', '--recipe', 'pppo']) == 2;"
        " assert 'torch' not in sys.modules and 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
