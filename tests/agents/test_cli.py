"""The command line: every command runs and writes its results."""

from agents.cli import main


def test_a_run_is_trained_resumed_and_evaluated(tmp_path):
    run = str(tmp_path / "run")
    small = ["n_envs=8", "n_steps=32", "batch_size=64", "policy_kwargs.net_arch=[8]"]

    assert main(["train", "--out", run, "--steps", "256", "--set", *small]) == 0
    assert main(["train", "--resume", run, "--steps", "512"]) == 0
    assert main(["evaluate", run, "--episodes", "3", "--scheme", "S10 S10"]) == 0
    assert main(["train", "--out", run]) == 2
    assert main(["train", "--resume", run, "--set", "n_envs=8"]) == 2
