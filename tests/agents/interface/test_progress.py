"""Progress of a command, also without a terminal."""

import io
import re
import time

from rich.console import Console

from agents.interface import progress
from agents.interface.progress import progress_display


def wait_for(stream, text):
    """Wait until a stream contains a text; a minute at most, on a busy machine."""
    end = time.monotonic() + 60.0
    while text not in stream() and time.monotonic() < end:
        time.sleep(0.01)
    assert text in stream()


def test_without_a_terminal_lines_come_on_the_standard_error_stream(monkeypatch):
    monkeypatch.setattr(progress, "FIRST_LINE", 0.01)
    errors = io.StringIO()
    output = io.StringIO()
    monkeypatch.setattr("sys.stderr", errors)
    with progress_display(Console(file=output)) as display:
        task = display.add_task("Training", total=200, note="")
        display.update(task, completed=100, note="reward [b]+0.5")
        wait_for(errors.getvalue, "Training: 50 % after 0:0")
        wait_for(errors.getvalue, ": reward [b]+0.5\n")
        display.update(task, completed=200)
        next_task = display.add_task("Evaluating", total=10, note="")
        wait_for(errors.getvalue, "Evaluating: 0 %")
        display.advance(next_task, 10)

    assert output.getvalue() == ""
    lines = errors.getvalue().splitlines()
    pattern = r"(Training|Evaluating): \d+ % after \d:\d\d:\d\d(, about \d:\d\d:\d\d left)?(: .*)?"
    assert all(re.fullmatch(pattern, line) for line in lines)
    before = errors.getvalue()
    time.sleep(0.1)
    assert errors.getvalue() == before


def test_a_short_command_prints_no_lines(capsys):
    with progress_display(Console(file=io.StringIO())) as display:
        display.update(
            display.add_task("Reading", total=1.0, note=""),
            completed=1.0,
        )
    assert capsys.readouterr().err == ""
