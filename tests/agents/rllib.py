"""RLlib with only the id replaced, in an environment of its own: `make rllib`."""

import pytest
from ray.rllib.algorithms.ppo import PPOConfig

# Those of RLlib are not ours.
pytestmark = pytest.mark.filterwarnings("ignore")


def test_rllib_builds_and_trains_by_id():
    config = PPOConfig().environment("hybrid_env:HybridTrack-v0").env_runners(num_env_runners=0)
    algorithm = config.training(train_batch_size_per_learner=400, num_epochs=1).build_algo()
    try:
        assert algorithm.train()["num_env_steps_sampled_lifetime"] >= 400
    finally:
        algorithm.stop()
