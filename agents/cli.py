"""The console script `hybridtrack`. Each subcommand is defined in a file of its own; errors are one line."""

import contextlib
import io
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


def one_line(message: str) -> str:
    """A message without line breaks, and without the frame and help hints of tyro's messages."""
    body = [line for line in message.splitlines() if not line.startswith(("╭", "╰"))]
    words = " ".join(re.sub("[\u2500-\u257f]", " ", " ".join(body)).split())
    return re.sub(r"^Error parsing | (Argument helptext|For full helptext).*", "", words)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: command-line arguments; None takes those of the process.

    Returns:
        The exit status: 0, 2 for an invalid argument, or 130 after an interrupt by the user.
    """
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
            print("hybridtrack: " + one_line(errors.getvalue()), file=sys.stderr)
        return int(stop.code or 0)
    try:
        command.run()
    except (ArgumentError, gym.error.Error) as error:
        print("hybridtrack: " + one_line(str(error)), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("hybridtrack: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
