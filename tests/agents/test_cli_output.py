"""Output of the command line: its width, and a reader that closes it."""

import os
import subprocess
import sys


def test_a_reader_that_closes_the_output_ends_the_command_quietly():
    end, closed = os.pipe()
    os.close(end)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "agents.cli",
            *["evaluate", "ate", "--episodes", "2", "--scheme", "S9"],
        ],
        stdout=closed,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(closed)

    assert done.returncode == 1
    # Progress, and what is compiled the first time.
    others = ("Loading", "0:00:", "HybridTrack: compiling")
    assert [text for text in done.stderr.splitlines() if not text.startswith(others)] == []
