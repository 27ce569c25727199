"""The progress display with a clock of the test: the time left passes, and the label is what runs
now.
"""

import io
import re
import threading

import pytest
from rich.console import Console

from agents.interface.progress import Calls, Report, TimeLeft, progress_display


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def lines_of(display, clock, pauses, capsys):
    """The lines that a display prints in that many pauses, with the seconds of each pause."""
    waited = []

    def wait(seconds):
        waited.append(seconds)
        clock.now += seconds
        return len(waited) > pauses

    display.print_lines(wait)
    return capsys.readouterr().err.splitlines(), waited


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def display(clock, monkeypatch):
    display = progress_display(Console(file=io.StringIO()), clock=clock)
    monkeypatch.setattr(display, "_left", TimeLeft(), raising=False)
    return display


def test_the_time_left_passes_between_two_updates(display, clock, capsys):
    bar = display.add_task("Scoring ATE", total=4, note="")
    clock.now += 30.0
    display.update(bar, completed=1)
    # Seen when it is a quarter: 90 s are left.
    assert "25 %, 0:01:30 left" in display.line()

    lines, _ = lines_of(display, clock, 4, capsys)
    left = [
        int(minutes) * 60 + int(seconds)
        for minutes, seconds in re.findall(r"0:(\d+):(\d+) left", "\n".join(lines))
    ]
    assert left == [90, 80, 70, 60]


def test_a_task_that_takes_longer_than_predicted_has_no_time_left(display, clock):
    bar = display.add_task("Scoring ATE", total=2, note="")
    clock.now += 5.0
    display.update(bar, completed=1)
    assert "0:00:05 left" in display.line()
    clock.now += 6.0

    assert display.line() == "0:00:11 Scoring ATE: 50 %"


def test_the_label_is_what_runs_now_in_every_process(display, clock, tmp_path):
    reports = [Report(tmp_path / str(number)) for number in range(3)]
    calls = Calls(display, "Comparing 3 deciders", reports)
    calls.look()
    assert display.line() == "0:00:00 Comparing 3 deciders: 0 %"

    clock.now += 8.0
    reports[0]("Training ppo", 0.5, 0.3)
    reports[1]("Scoring ATE", 0.1, 0.6)
    calls.look()
    assert display.line().split("; ") == [
        "0:00:08 Comparing 3 deciders: 30 %, 0:00:19 left",
        "Training ppo: 50 %",
        "Scoring ATE: 10 %",
    ]

    clock.now += 8.0
    reports[0]("Scoring ppo", 0.0, 0.7)
    reports[1]("", 1.0, 1.0)
    calls.look()
    clock.now += 2.0
    reports[0]("Scoring ppo", 0.5, 0.85)
    calls.look()
    # What has ended is not named, and the time left is that of the scoring.
    assert display.line().split("; ")[1:] == ["Scoring ppo: 50 %, 0:00:02 left"]


def test_what_is_read_while_a_call_reports_is_never_half_a_line(tmp_path):
    report, ended = Report(tmp_path / "0"), threading.Event()

    def say():
        while not ended.is_set():
            report("Scoring ATE", 0.123456789, 0.987654321)

    thread = threading.Thread(target=say)
    thread.start()
    while (said := report.read()) is None:
        pass
    read = {said, *(report.read() for _ in range(2000))}
    ended.set()
    thread.join()

    assert read == {("Scoring ATE", 0.123456789, 0.987654321)}
