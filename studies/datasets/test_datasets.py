"""Data sets of Minari: loaded by Minari, and replayed in the environment that they name."""

import numpy as np
import pytest

minari = pytest.importorskip("minari")
pytest.importorskip("h5py")


@pytest.mark.parametrize(
    ("env_id", "rule"),
    [("HybridTrackPublished-v0", "ate"), ("HybridTrackQuickest-v0", "threshold")],
)
def test_episodes_of_a_data_set_are_those_of_its_environment(
    tmp_path, monkeypatch, run_study, env_id, rule
):
    flags = ["--env", env_id, "--quick", "--out", str(tmp_path)]
    printed = run_study("datasets", rule, "random", *flags)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    for name in (rule, "random"):
        data = minari.load_dataset(f"{env_id}/{name}-v0")
        assert f"{env_id}/{name}-v0: 5 episodes, {data.total_steps:,} steps" in printed
        env = data.recover_environment()
        for number, episode in enumerate(data.iterate_episodes()):
            first = env.reset(seed=5_000_000_000 + number)
            steps = [env.step(action) for action in episode.actions]
            _, rewards, terminated, *_ = zip(*steps, strict=True)
            assert terminated[-1]
            np.testing.assert_array_equal(rewards, episode.rewards)
            seen = [first, *(step[::4] for step in steps)]
            for now, (observation, info) in enumerate(seen):
                np.testing.assert_array_equal(observation, episode.observations[now])
                assert info["true_mode"] == episode.infos["true_mode"][now]
