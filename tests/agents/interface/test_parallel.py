"""Independent calls in processes: order, lost workers, errors, and equal results of a study."""

import functools
import os
import signal

import pytest
from small_training import small_recipe

from agents.cli import main
from agents.interface import parallel
from agents.interface.parallel import Workers
from agents.interface.world_arguments import trusted, trusting
from hybrid_env.checks import ArgumentError


def square(number):
    return number**2, os.getpid()


def killed_once(marker, number):
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def refused():
    raise ArgumentError("radii=0 is not allowed: expected a number > 0")


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_calls(jobs):
    done = []
    calls = {f"call {number}": functools.partial(square, number) for number in range(6)}
    results = list(Workers(jobs).results(calls, done.append))

    assert [name for name, _ in results] == list(calls)
    assert [result for _, (result, _) in results] == [0, 1, 4, 9, 16, 25]
    assert sorted(done) == list(calls)
    processes = {process for _, (_, process) in results}
    assert (os.getpid() in processes) == (jobs == 1)


def test_the_call_of_a_lost_worker_is_repeated(tmp_path):
    calls = {
        number: functools.partial(killed_once, tmp_path / "killed", number) for number in range(4)
    }
    assert dict(Workers(2).results(calls)) == {number: number for number in range(4)}
    assert list(Workers(2).results({})) == []
    assert (tmp_path / "killed").exists()


def test_a_call_that_always_ends_its_worker_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(parallel, "LARGEST_RETRIES", 0)
    calls = {number: functools.partial(os._exit, 1) for number in range(2)}
    with pytest.raises(ArgumentError, match="workers were lost 1 times: expected enough memory"):
        list(Workers(2).results(calls))


def test_the_error_of_a_call_is_raised():
    with pytest.raises(ArgumentError, match="radii=0 is not allowed"):
        list(Workers(2).results({"one": refused, "other": functools.partial(square, 2)}))


def compare_in_one_and_two_processes(command, tmp_path):
    for jobs in ("1", "2"):
        assert main([*command, "--jobs", jobs, "--out", str(tmp_path / jobs)]) == 0
    for name in ("compare.json", "compare.png", "episode.png"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_a_comparison_in_two_processes_writes_the_bytes_of_the_serial_one(tmp_path):
    recipe = str(small_recipe(tmp_path))
    command = ["compare", "--deciders", "ml", "fixed", "--agents", recipe, "--training-seeds", "2"]
    command += ["--steps", "1280", "--episodes", "4", "--selection-episodes", "4"]
    command += ["--scheme", "random 2x20-30"]
    compare_in_one_and_two_processes(command, tmp_path)


def test_workers_trust_what_the_command_trusts_and_no_longer():
    calls = dict.fromkeys(range(4), trusted)
    for trust in (True, False, True):
        with trusting(trust):
            assert {trusts for _, trusts in Workers(2).results(calls)} == {trust}

    assert not trusted()
