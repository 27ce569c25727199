"""The console script `hybridtrack`. Each subcommand is defined in a file of its own; errors are
one line.
"""

import contextlib
import functools
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import tyro

from agents.commands.compare import Compare
from agents.commands.evaluate import Evaluate
from agents.commands.play import Play
from agents.commands.score import Score
from agents.commands.track import Track
from agents.commands.train import Train
from agents.interface.help_texts import as_command
from agents.interface.world_arguments import trusting
from hybrid_env.checks import ArgumentError, check_fields

COMMANDS = {kind.__name__.lower(): kind for kind in (Train, Evaluate, Compare, Play, Track, Score)}
EXAMPLES = {
    "": """
hybridtrack play --decider ate --out episode.gif   # watch the classical rule
hybridtrack train --out runs/ppo                   # train an agent, half a minute
hybridtrack evaluate ate shipped runs/ppo          # on the same episodes
hybridtrack compare --help                         # flags and examples of a command
hybridtrack --version""",
    "train": """
hybridtrack train --out runs/ppo --seed 1
hybridtrack train --recipe anchor --out runs/anchor --measurement-variance 0.5
hybridtrack train --resume runs/ppo --steps 3000000
hybridtrack train --set n_envs=128 policy_kwargs.net_arch=[32]
hybridtrack train --env HybridTrackQuickest-v0 --recipe rhythm""",
    "evaluate": """
hybridtrack evaluate ate:1e-6 msprt:0.02 fixed:30 shipped
hybridtrack evaluate runs/ppo:-1 --episodes 3000 --out ppo.json
hybridtrack evaluate shipped calibrated --noise 'outliers 0.05'
hybridtrack evaluate shipped beam threshold:0.7 --env HybridTrackQuickest-v0""",
    "compare": """
hybridtrack compare                                # trains PPO, draws the operating curves
hybridtrack compare --agents shipped runs/anchor --measurement-variance 1
hybridtrack compare --agents ppo --training-seeds 5 --jobs 2 --out results/seeds
hybridtrack compare --deciders ate mine.py:MyRule --agents model.zip
hybridtrack compare --no-curves --episodes 300     # a first look
hybridtrack compare --env HybridTrackBank-v0 --deciders ate msprt-type msprt --accuracy 0.9""",
    "play": """
hybridtrack play --decider shipped                 # in a window
hybridtrack play --decider msprt:0.02 --out episode.gif
hybridtrack play --env HybridTrackQuickest-v0 --decider beam --out episode.png
hybridtrack play --scheme 'L60r3 R75r5 S50' --radii 3 5 --out flight.gif --record flight.csv""",
    "track": """
hybridtrack track flight.csv --lengths 50 --radii 3 5 10
hybridtrack track flight.csv --lengths 60 75 50 --radii 3 5 --measurement-variance 0.1""",
    "score": """
hybridtrack score truth.csv imm.csv mine.csv --out score.json
hybridtrack score truth.csv mine.csv --columns time=1 mode=4 --per min --picture score.png""",
}
"""Lines below the help of each command; a test parses them."""

PROGRAM = "hybridtrack"


def one_line(message: str) -> str:
    """A message without line breaks, and without the frame and help hints of tyro's messages."""
    body = [line for line in message.splitlines() if not line.startswith(("╭", "╰"))]
    words = " ".join(re.sub("[\u2500-\u257f]|-{3,}", " ", " ".join(body)).split())
    words = re.sub(r"^(Unrecognized options) \1", r"\1", words)
    text = re.sub(r"^Error parsing | (Argument helptext|For full helptext).*", "", words)
    # The middle of a long message is left out.
    return text if len(text) <= 270 else f"{text[:180]} ... {text[-85:]}"


def parse(arguments: Sequence[str]) -> Any:
    """Return the command of command-line arguments, ready to run."""
    name = arguments[0] if arguments else ""
    # The flags of one command are parsed much sooner than those of all.
    if name in COMMANDS:
        return _parse_flags(COMMANDS[name], f"{PROGRAM} {name}", arguments[1:])
    words = "Quickest decisions on motion modes with classical rules and learned agents."
    kinds: dict[str, Any] = {name: as_command(kind)[0] for name, kind in COMMANDS.items()}
    return tyro.extras.subcommand_cli_from_dict(
        kinds, prog=PROGRAM, args=arguments, description=words
    )


def _parse_flags(command: type, program: str, arguments: Sequence[str]) -> Any:
    """Return a command with the flags of its command line."""
    kind, description = as_command(command)
    # A flag is left out, not given as "None".
    config = (tyro.conf.DisallowNone,)
    return tyro.cli(kind, prog=program, args=arguments, description=description, config=config)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command of `hybridtrack`; arguments and exit status as of `run_command`."""
    return _main(parse, PROGRAM, arguments)


def run_command(command: type, program: str, arguments: Sequence[str] | None = None) -> int:
    """Run one command as a program, in the way of those of `hybridtrack`.

    Args:
        command: a dataclass with the method `run()`. Its fields are the flags, described by the
            docstrings below them.
        program: its name in the help and in messages.
        arguments: of the command line; None takes those of the process.

    Returns:
        The exit status: 0, 1 if the reader of the output has closed it, 2 for an invalid argument
        or a file that cannot be read or written, of which one line is printed, or 130 after an
        interrupt by the user.
    """
    return _main(functools.partial(_parse_flags, command, program), program, arguments)


def _main(
    parser: Callable[[Sequence[str]], Any],
    program: str,
    arguments: Sequence[str] | None,
) -> int:
    def report(message: str) -> None:
        with contextlib.suppress(OSError):
            print(f"{program}: {one_line(message)}", file=sys.stderr)

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # Names of files may contain any bytes.
            stream.reconfigure(errors="backslashreplace")
    try:
        status = _run(parser, report, sys.argv[1:] if arguments is None else arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except BrokenPipeError:
        _discard_output()
        return 1
    except (ArgumentError, gym.error.Error, OSError, MemoryError) as error:
        if isinstance(error, OSError):
            _discard_output()
        report(f"not enough memory: {error}" if isinstance(error, MemoryError) else str(error))
        return 2
    except KeyboardInterrupt as interrupt:
        report(": ".join(["interrupted", *map(str, interrupt.args)]))
        return 130


def _run(
    parser: Callable[[Sequence[str]], Any],
    report: Callable[[str], None],
    arguments: Sequence[str],
) -> int:
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            command = parser(arguments)
    except SystemExit as stop:
        if stop.code:
            report(errors.getvalue())
        elif parser is parse:
            examples = EXAMPLES.get(arguments[0], EXAMPLES[""])
            print("examples:" + examples.replace("\n", "\n  "))
        return int(stop.code or 0)
    check_fields(command)
    with warnings.catch_warnings(), trusting(getattr(command, "trust", False)):
        warnings.showwarning = lambda message, *_: report(f"warning: {message}")
        try:
            command.run()
        except SystemExit as stop:
            # Rich ends the program where nobody reads its output.
            if isinstance(stop.__context__, BrokenPipeError):
                raise
            raise ArgumentError(
                f"code of a decider ended the program (status {stop.code})"
            ) from stop
    return 0


def _discard_output() -> None:
    """Discard output that could not be written; Python would otherwise report it again at exit."""
    with contextlib.suppress(OSError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
