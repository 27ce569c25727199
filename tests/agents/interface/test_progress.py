"""The progress display with a clock of the test: what runs, how much is done, and the time left."""

import io
import threading

from rich.console import Console

from agents.interface.progress import calls_shown, progress_display, read_progress, write_progress


def test_lines_say_what_runs_and_the_time_left(capsys):
    now = [100.0]
    display = progress_display(Console(file=io.StringIO()), clock=lambda: now[0])
    bar = display.add_task("Scoring ATE", total=4, note="")
    for _ in range(2):
        now[0] += 30.0
        display.update(bar, completed=display.tasks[0].completed + 1, note="tick 7")

    waits = iter((False, True))
    display.print_lines(lambda seconds: next(waits))

    assert capsys.readouterr().err == "0:01:00 Scoring ATE: 50 %, 0:01:00 left, tick 7\n"


def test_calls_are_one_bar_with_the_labels_of_those_that_run():
    display = progress_display(Console(file=io.StringIO()))
    with calls_shown(display, "Comparing 3 deciders", 3) as reports:
        reports[0]("Training ppo", 0.5)
        reports[1]("Scoring ATE", 0.25)
        reports[2]("", 1.0)

    assert display.line().startswith("0:00:00 Comparing 3 deciders: 58 %")
    assert display.line().endswith("Training ppo; Scoring ATE")


def test_what_is_read_while_a_call_reports_is_never_half_a_line(tmp_path):
    path, ended = tmp_path / "0", threading.Event()
    assert read_progress(path) == ("", 0.0)
    write_progress(path, "Scoring ATE", 0.987654321)

    def say():
        while not ended.is_set():
            write_progress(path, "Scoring ATE", 0.987654321)

    thread = threading.Thread(target=say)
    thread.start()
    read = {read_progress(path) for _ in range(2000)}
    ended.set()
    thread.join()

    assert read == {("Scoring ATE", 0.987654321)}
