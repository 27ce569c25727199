"""Learning libraries with only the id replaced. Those that are not in the development extra are
optional.
"""

import gymnasium as gym
import pytest

import hybrid_env

EASY = "hybrid_env:HybridTrack-v0"
IDS = tuple(hybrid_env.ENVIRONMENTS)

# Those of other libraries are not ours.
pytestmark = pytest.mark.filterwarnings("ignore")


def test_stable_baselines3_learns_with_its_defaults():
    from stable_baselines3 import PPO

    # The id is enough.
    model = PPO(
        "MlpPolicy",
        EASY,
        device="cpu",
        seed=0,
    )
    model.learn(2048)

    assert model.num_timesteps == 2048


@pytest.mark.parametrize("env_id", IDS)
def test_torchrl_gym_env(env_id):
    envs = pytest.importorskip("torchrl.envs")
    # Tries the keyword frameskip first.
    env = envs.GymEnv(f"hybrid_env:{env_id}")
    env.auto_register_info_dict()
    rollout = env.rollout(20)

    assert rollout["observation"].shape[-1] == env.observation_spec["observation"].shape[-1]
    assert rollout["next", "tick"].dtype.is_floating_point is False
    envs.check_env_specs(env)


def test_tianshou_collects_steps_of_a_policy():
    env = pytest.importorskip("tianshou.env")
    data = pytest.importorskip("tianshou.data")
    from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
    from tianshou.utils.net.common import Net
    from tianshou.utils.net.discrete import DiscreteActor

    workers = env.DummyVectorEnv([lambda: gym.make(EASY) for _ in range(2)])
    actor = DiscreteActor(
        preprocess_net=Net(state_shape=(28,), hidden_sizes=[16]),
        action_shape=4,
        softmax_output=False,
    )
    policy = DiscreteActorPolicy(actor=actor, action_space=gym.make(EASY).action_space)
    collector = data.Collector(policy, workers, data.VectorReplayBuffer(200, 2))
    collector.reset()

    assert collector.collect(n_step=100).n_collected_steps == 100


def test_rllib_builds_and_trains_by_id():
    ppo = pytest.importorskip("ray.rllib.algorithms.ppo")
    config = ppo.PPOConfig().environment(EASY).env_runners(num_env_runners=0)
    algorithm = config.training(train_batch_size_per_learner=400, num_epochs=1).build_algo()
    try:
        assert algorithm.train()["num_env_steps_sampled_lifetime"] >= 400
    finally:
        algorithm.stop()


def clean_rl_environment(env_id, index):
    """As `make_env` of CleanRL's ppo.py, without the video."""

    def thunk():
        env = gym.wrappers.RecordEpisodeStatistics(gym.make(env_id))
        env.action_space.seed(index)
        return env

    return thunk


def test_the_vector_loop_of_clean_rl():
    envs = gym.vector.SyncVectorEnv([clean_rl_environment(EASY, index) for index in range(4)])
    assert isinstance(envs.single_action_space, gym.spaces.Discrete)
    envs.reset(seed=1)
    lengths = []
    for _ in range(400):
        *_, infos = envs.step(envs.action_space.sample())
        if "episode" in infos:
            lengths += infos["episode"]["l"][infos["_episode"]].tolist()
    assert len(lengths) > 4
    assert min(lengths) >= 6
