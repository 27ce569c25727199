"""Trains a small agent in a folder, or resumes it: in this process, or in another one that is
killed.

Usage: python small_training.py <kind> <folder> <steps> <seconds between checkpoints>
"""

import functools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import small_network
import torch

from agents.evaluation.registry import learned_decider
from agents.learned.policy_file import load_policy
from agents.training.learning_curve import LearningCurve
from agents.training.recipe import load_recipe
from agents.training.run_folder import CONFIG, read_metrics
from agents.training.runs import make_run, resume_run
from baselines.rules.decider import UNKNOWN
from baselines.rules.rollout import record_decisions, record_statements
from hybrid_env import QuickestOptions, WorldOptions

STEPS = 1920
SMALL_PPO = (
    "n_envs=20",
    "n_steps=32",
    "batch_size=320",
    "n_epochs=2",
    "policy_kwargs.net_arch=[16]",
)
QUICK = {"ticks": 50, "durations": "uniform 5-20"}
SCHEME = {"scheme": "random 2x20-30"}
SMALL_Q = (
    "n_envs=20",
    "train_freq=16",
    "learning_starts=320",
    "buffer_size=1000",
    "batch_size=32",
    "policy_kwargs.net_arch=[16]",
)
PUBLISHED = "HybridTrackPublished-v0"
KINDS = {
    "ppo": ("ppo", PUBLISHED, SCHEME, SMALL_PPO),
    "recurrent-ppo": (
        "recurrent-ppo",
        PUBLISHED,
        SCHEME,
        (*SMALL_PPO, "policy_kwargs.lstm_hidden_size=8"),
    ),
    "a2c": ("a2c", PUBLISHED, SCHEME, ("n_envs=20", "n_steps=32", "policy_kwargs.net_arch=[16]")),
    "dqn": ("dqn", PUBLISHED, SCHEME, SMALL_Q),
    "qrdqn": ("qrdqn", PUBLISHED, SCHEME, (*SMALL_Q, "policy_kwargs.n_quantiles=5")),
    "ppo-quickest": ("ppo", "HybridTrackQuickest-v0", QUICK, SMALL_PPO),
    "network": (str(Path(small_network.__file__).with_suffix(".yml")), PUBLISHED, SCHEME, ()),
}
"""Recipe, environment, its options and changed hyper-parameters."""
WALL_CLOCK = ("seconds", "time/fps", "time/time_elapsed")


def log_often(set_value=setattr):
    """Evaluate often and briefly, so that a small training writes several lines of metrics."""
    set_value(LearningCurve, "episodes", 5)


def small_run(kind, folder=None, steps=STEPS, seed=3, kinds=KINDS):
    """A new run."""
    if kind in ("recurrent-ppo", "qrdqn"):
        pytest.importorskip("sb3_contrib")
    recipe, env, options, changes = kinds[kind]
    recipe = load_recipe(recipe, env, changes)
    return make_run(f"hybrid_env:{env}", options, recipe, seed, folder, steps)


def small_recipe(folder, kind="ppo"):
    """A file with the recipe of a small agent; its name is that of the agent."""
    recipe, env, _, changes = KINDS[kind]
    path = folder / f"small-{kind}.yml"
    path.write_text(json.dumps({"default": load_recipe(recipe, env, changes).as_json()["entry"]}))
    return path


def outcome(folder):
    """Metrics, card and weights of a run, without times."""
    rows = [{k: v for k, v in row.items() if k not in WALL_CLOCK} for row in read_metrics(folder)]
    saved = load_policy(folder)
    card = saved.card
    card["measured"].pop("seconds")
    card.pop("seconds")
    return json.dumps([rows, card]), {
        name: value.numpy().tobytes() for name, value in saved.weights.items()
    }


def interrupt_at(steps):
    def interrupt(progress):
        if progress.steps >= steps:
            raise KeyboardInterrupt

    return interrupt


def interrupted(kind, folder, at, kinds=KINDS):
    """A folder of a run that was interrupted; checkpoints after every update."""
    run = small_run(kind, folder, kinds=kinds)
    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt_at(at), save_every=0.0)
    return folder


def whole_runs(folder, kinds=KINDS):
    """A function that returns the run of an uninterrupted training of a kind, made once."""

    @functools.cache
    def run_of(kind):
        run = small_run(kind, folder / kind, kinds=kinds)
        run.train()
        return run

    return run_of


def assert_folder_decides_as(run, options):
    """Check that the agent of a run folder decides as the trained one."""
    unknown = run.switches == UNKNOWN
    world = (QuickestOptions if unknown else WorldOptions)(**options)
    decided = [
        record_statements(decider, 3, 3, **options).stated_modes
        if unknown
        else record_decisions(decider, run.env_id, 3, 1, **options).ticks
        for decider in (learned_decider(run.folder, world), run.agent(""))
    ]
    np.testing.assert_array_equal(*decided)


def main(kind, folder, steps, save_every):
    """Start or continue a training; print a line when it begins and after every rollout."""
    run = resume_run(folder) if (folder / CONFIG).exists() else small_run(kind, folder, steps)
    print("training", flush=True)
    run.train(lambda now: print(now.steps, flush=True), save_every)


if __name__ == "__main__":
    torch.set_num_threads(1)
    log_often()
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
