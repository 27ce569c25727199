"""The console script `hybridtrack`. Each subcommand is defined in a file of its own; errors are
one line.
"""

import ast
import contextlib
import dataclasses
import functools
import importlib
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import tyro

from agents import commands
from agents.commands import COMMANDS, EXAMPLES
from agents.interface.help_texts import ENV_HELP, ENVIRONMENT, description, parse_flags
from hybrid_env.checks import ArgumentError, check_fields, unknown


def one_line(message: str) -> str:
    """A message without line breaks, and without the frame and help hints of tyro's messages."""
    body = [line for line in message.splitlines() if not line.startswith(("╭", "╰"))]
    words = " ".join(re.sub("[\u2500-\u257f]|-{3,}", " ", " ".join(body)).split())
    words = re.sub(r"^(Unrecognized options) \1", r"\1", words)
    text = re.sub(r"^Error parsing | (Argument helptext|For full helptext).*", "", words)
    # The middle of a long message is left out.
    return text if len(text) <= 270 else f"{text[:180]} ... {text[-85:]}"


def command_class(name: str) -> Any:
    """Return the class of a command of `hybridtrack`."""
    return getattr(importlib.import_module(f"agents.commands.{name}"), name.title())


def command_docstring(name: str) -> str | None:
    """Return the docstring of the class of a command from its source: the commands load slowly."""
    source = Path(commands.__file__).with_name(f"{name}.py").read_text(encoding="utf-8")
    classes = (node for node in ast.parse(source).body if isinstance(node, ast.ClassDef))
    return next(ast.get_docstring(node) for node in classes if node.name == name.title())


def parse(arguments: Sequence[str]) -> Any:
    """Return the command of command-line arguments, ready to run."""
    name = arguments[0] if arguments else ""
    # The flags of one command are parsed much sooner than those of all.
    if name in COMMANDS:
        return _parse(command_class(name), f"hybridtrack {name}", arguments[1:])
    if name and not name.startswith("-"):
        raise unknown("command", name, COMMANDS)
    words = "Quickest decisions on motion modes with classical rules and learned agents."
    kinds: dict[str, Any] = {}
    for name in COMMANDS:
        kinds[name] = dataclasses.make_dataclass(name, ())
        kinds[name].__doc__ = description(command_docstring(name))
    return tyro.extras.subcommand_cli_from_dict(
        kinds, prog="hybridtrack", args=arguments, description=words
    )


def _parse(command: Any, program: str, arguments: Sequence[str]) -> Any:
    """Return a command with the flags of its command line; raise `ArgumentError` for a flag that
    does not exist.
    """
    if ENV_HELP in arguments and ENVIRONMENT in getattr(command, "GROUPS", {}):
        from agents.interface.world_arguments import print_options

        print_options(arguments)
        raise SystemExit(0)
    known, values = ["--help"], []
    for field in dataclasses.fields(command):
        name = field.name.replace("_", "-")
        if tyro.conf.Positional in getattr(field.type, "__metadata__", ()):
            values.append(name)
            continue
        known += [f"--{name}", f"--no-{name}"] if isinstance(field.default, bool) else [f"--{name}"]
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            return parse_flags(command, program, arguments)
    except SystemExit as stop:
        if not stop.code:
            raise
        message = one_line(errors.getvalue())
        flag = re.match(r"Unrecognized options: (--[\w-]+)", message)
        if flag and flag[1].strip("-s") in [name.strip("s") for name in values]:
            words = "its values stand without a flag"
            raise ArgumentError(f"flag={flag[1]!r} does not exist: {words}") from None
        if flag:
            raise unknown("flag", flag[1], known, f"see {program} --help") from None
        raise ArgumentError(message) from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command of `hybridtrack`; arguments and exit status as of `run_command`."""
    return _main(parse, "hybridtrack", arguments)


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
    return _main(functools.partial(_parse, command, program), program, arguments)


def _main(
    parser: Callable[[Sequence[str]], Any], program: str, arguments: Sequence[str] | None
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
        # Processes that end with this one would warn.
        warnings.simplefilter("ignore")
        return 130


def _run(
    parser: Callable[[Sequence[str]], Any], report: Callable[[str], None], arguments: Sequence[str]
) -> int:
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            command = parser(arguments)
    except SystemExit as stop:
        if stop.code:
            report(errors.getvalue())
        elif parser is parse and ENV_HELP not in arguments:
            examples = EXAMPLES.get(arguments[0], EXAMPLES[""])
            print("examples:" + examples.replace("\n", "\n  "))
        return int(stop.code or 0)
    check_fields(command)
    from agents.interface.world_arguments import trusting

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
