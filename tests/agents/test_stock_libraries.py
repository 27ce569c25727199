"""Learning libraries with only the id replaced. RLlib, which needs an older Gymnasium, is in
`rllib.py`.
"""

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env
from hybrid_env.wrappers import CompleteInfo

EASY = "hybrid_env:HybridTrack-v0"
IDS = tuple(hybrid_env.ENVIRONMENTS)

# Those of other libraries are not ours.
pytestmark = pytest.mark.filterwarnings("ignore")


def test_stable_baselines3_learns_with_its_defaults():
    from stable_baselines3 import PPO

    # The id is enough.
    model = PPO("MlpPolicy", EASY, device="cpu", seed=0)
    model.learn(2048)

    assert model.num_timesteps == 2048


@pytest.mark.parametrize("env_id", IDS)
def test_torchrl_gym_env(env_id):
    from torchrl import envs

    # Tries the keyword frameskip first.
    env = envs.GymEnv(f"hybrid_env:{env_id}")
    env.auto_register_info_dict()
    rollout = env.rollout(20)

    assert rollout["observation"].shape[-1] == env.observation_spec["observation"].shape[-1]
    assert rollout["next", "tick"].dtype.is_floating_point is False
    envs.check_env_specs(env)


def test_tianshou_collects_steps_of_a_policy():
    from tianshou import data, env
    from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
    from tianshou.utils.net.common import Net
    from tianshou.utils.net.discrete import DiscreteActor

    workers = env.DummyVectorEnv([lambda: gym.make(EASY) for _ in range(2)])
    actor = DiscreteActor(
        preprocess_net=Net(state_shape=(29,), hidden_sizes=[16]),
        action_shape=4,
        softmax_output=False,
    )
    policy = DiscreteActorPolicy(actor=actor, action_space=gym.make(EASY).action_space)
    collector = data.Collector(policy, workers, data.VectorReplayBuffer(200, 2))
    collector.reset()

    assert collector.collect(n_step=100).n_collected_steps == 100


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        (EASY, {"missed": 0.5, "bank_info": True}),
        ("hybrid_env:HybridTrackQuickest-v0", {"ticks": 20}),
    ],
)
def test_a_data_set_of_minari_makes_its_environment_again(tmp_path, monkeypatch, env_id, options):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    import minari

    env = CompleteInfo(gym.make(env_id, **options))
    collector = minari.DataCollector(env, record_infos=True)
    for seed in (5, 6):
        collector.reset(seed=seed)
        ended = False
        while not ended:
            ended = any(collector.step(0)[2:4])
    collector.create_dataset("hybridtrack/wait-v0")
    collector.close()

    data = minari.load_dataset("hybridtrack/wait-v0")
    again = data.recover_environment()
    assert str(again) == str(env)
    assert again.unwrapped.options == env.unwrapped.options
    for episode in data:
        rows = [again.reset(seed=int(episode.id) + 5)[0]]
        rows += [again.step(action)[0] for action in episode.actions]
        np.testing.assert_array_equal(rows, episode.observations)


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
