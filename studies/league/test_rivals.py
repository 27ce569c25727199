"""Every rival: a resumed training equals an uninterrupted one, and weights give the same agent."""

import numpy as np
import pytest
import torch

from agents import load, load_recipe
from agents.training.runs import make_run, resume_run
from studies.league.families import RECIPES, home_of
from studies.league.protocol import QUICKEST

NAMES = sorted(path.stem for path in RECIPES.glob("*.yml"))
SEGMENTS = ("n_envs=8", "hidden=6", "batch_size=16")
VALUES = ("n_envs=20", "train_freq=16", "learning_starts=320", "buffer_size=1000", "batch_size=32")
CHANGES = dict.fromkeys(("q-linear", "q-deep"), VALUES) | {
    "jump-markov": (
        "n_envs=8",
        "batch_size=8",
        "n_steps=25",
        "hidden=6",
        "durations=[uniform 5-20]",
    )
}


def small_run(name, folder, steps):
    env_id = home_of(name)
    options = {"ticks": 50} if env_id == QUICKEST else {"scheme": "random 2x20-30"}
    recipe = load_recipe(
        str(RECIPES / f"{name}.yml"),
        env_id,
        CHANGES.get(name, SEGMENTS),
    )
    return (
        make_run(
            env_id,
            options,
            recipe,
            3,
            folder,
            steps,
        ),
        env_id,
        options,
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_resumed_training_equals_an_uninterrupted_one(name, tmp_path):
    whole, env_id, options = small_run(
        name,
        tmp_path / "whole",
        2000,
    )
    whole.train()
    part, *_ = small_run(
        name,
        tmp_path / "part",
        2000,
    )

    def interrupt(now):
        if now.steps >= 800:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        part.train(interrupt, save_every=0.0)
    resumed = resume_run(tmp_path / "part")
    assert 0 < resumed.num_timesteps < whole.num_timesteps
    resumed.train()

    for name, weights in whole.network.state_dict().items():
        assert torch.equal(weights, resumed.network.state_dict()[name])
    rows = [
        load(
            str(tmp_path / folder),
            env_id,
            **options,
        )
        for folder in ("whole", "part")
    ]
    assert type(rows[0]) is type(rows[1])
    kept = rows[0].policy if hasattr(rows[0], "policy") else rows[0].net
    for name, weights in whole.network.state_dict().items():
        np.testing.assert_array_equal(weights, kept.state_dict()[name])
