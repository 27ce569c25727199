"""The examples of the help texts parse."""

import shlex
from dataclasses import replace

import pytest

from agents.cli import COMMANDS, EXAMPLES, parse

LINES = [(name, line) for name, lines in EXAMPLES.items() for line in lines.split("\n")[1:]]


@pytest.mark.parametrize(
    ("name", "line"),
    LINES,
    ids=[line for _, line in LINES],
)
def test_an_example_is_a_command_that_parses(name, line):
    program, *arguments = shlex.split(line, comments=True)
    assert program == "hybridtrack"
    if arguments[-1] in ("--help", "--version"):
        return
    command = parse(arguments)
    assert isinstance(command, COMMANDS[name or arguments[0]])
    assert replace(command) == command
