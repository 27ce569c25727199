"""Independent calls in processes: order, lost workers and trust."""

import functools
import os
import signal

from joblib.externals.loky import get_reusable_executor

from agents.interface.parallel import Workers
from agents.interface.world_arguments import trusted, trusting


def square(number):
    return number**2, os.getpid()


def killed_once(marker, number):
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_workers_do_not_import_modules_of_the_present_folder(tmp_path, monkeypatch):
    # Workers of other tests were started elsewhere.
    get_reusable_executor().shutdown()
    monkeypatch.chdir(tmp_path)
    # It may be relative.
    monkeypatch.delenv("PYTHONPATH", raising=False)
    (tmp_path / "lz4.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'x')")

    calls = {number: functools.partial(square, number) for number in range(2)}
    assert [result for _, (result, _) in Workers(jobs=2).results(calls)] == [0, 1]
    assert not (tmp_path / "ran").exists()


def test_the_call_of_a_lost_worker_is_repeated(tmp_path):
    calls = {
        number: functools.partial(killed_once, tmp_path / "killed", number) for number in range(4)
    }
    # In the order of the calls.
    assert list(Workers(jobs=2).results(calls)) == [(number, number) for number in range(4)]
    assert (tmp_path / "killed").exists()


def test_workers_trust_what_the_command_trusts_and_no_longer():
    calls = dict.fromkeys(range(4), trusted)
    for trust in (True, False):
        with trusting(trust):
            assert {trusts for _, trusts in Workers(jobs=2).results(calls)} == {trust}

    assert not trusted()
