"""Help texts: examples that parse, and defaults in words."""

import shlex
from dataclasses import replace

import pytest

from agents.cli import COMMANDS, EXAMPLES, main, parse

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


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_examples_and_no_none(name, capsys):
    assert main([name, "--help"]) == 0
    printed = capsys.readouterr().out
    for words in ("None", "default: )", "{True,False}"):
        assert words not in printed
    assert printed.index("examples:") > printed.index("options")
    assert EXAMPLES[name].replace("\n", "\n  ") in printed
