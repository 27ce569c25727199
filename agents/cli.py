"""The console script `hybridtrack`. Each subcommand is defined in a file of its own; errors are one line."""

import contextlib
import io
import os
import re
import sys
from collections.abc import Sequence
from typing import Annotated

import gymnasium as gym
import tyro

from agents.benchmark.command import Bench
from agents.comparison.command import Compare
from agents.evaluation.command import Evaluate
from agents.limits.command import Limits
from agents.playing.command import Play
from agents.recordings.command import Track
from agents.reproduction.command import Reproduce
from agents.training.command import Train
from hybrid_env.checks import ArgumentError

Command = (
    Annotated[Compare, tyro.conf.subcommand("compare")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Track, tyro.conf.subcommand("track")]
    | Annotated[Limits, tyro.conf.subcommand("limits")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Play, tyro.conf.subcommand("play")]
)


MAX_MESSAGE = 270  # characters; the middle of a longer message is left out


def one_line(message: str) -> str:
    """A message without line breaks, and without the frame and help hints of tyro's messages."""
    body = [line for line in message.splitlines() if not line.startswith(("╭", "╰"))]
    words = " ".join(re.sub("[\u2500-\u257f]|-{3,}", " ", " ".join(body)).split())
    text = re.sub(r"^Error parsing | (Argument helptext|For full helptext).*", "", words)
    return text if len(text) <= MAX_MESSAGE else f"{text[:180]} ... {text[-85:]}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: command-line arguments; None takes those of the process.

    Returns:
        The exit status: 0, 1 if the reader of the output has closed it, 2 for an invalid argument or a file
        that cannot be read or written, or 130 after an interrupt by the user.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may contain any bytes
    try:
        status = _run(arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except (ArgumentError, gym.error.Error) as error:
        _report(str(error))
        return 2
    except BrokenPipeError:
        _discard_output()
        return 1
    except OSError as error:
        _discard_output()
        _report(str(error))
        return 2
    except MemoryError as error:
        _report(f"not enough memory: {error}")
        return 2
    except KeyboardInterrupt:
        _report("interrupted")
        return 130


def _run(arguments: Sequence[str] | None) -> int:
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            command = tyro.cli(
                Command, prog="hybridtrack", args=arguments,
                description="Quickest decisions on motion modes with classical rules and learned agents.",
                config=(tyro.conf.FlagConversionOff,),
            )  # fmt: skip
    except SystemExit as stop:
        if stop.code:
            _report(errors.getvalue())
        return int(stop.code or 0)
    command.run()
    return 0


def _report(message: str) -> None:
    with contextlib.suppress(OSError):
        print("hybridtrack: " + one_line(message), file=sys.stderr)


def _discard_output() -> None:
    """Discard output that could not be written; Python would otherwise report it again at exit."""
    with contextlib.suppress(OSError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
