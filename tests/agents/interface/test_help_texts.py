"""The examples of the help texts parse."""

import re
import shlex
from dataclasses import replace

import pytest

from agents.cli import command_class, parse
from agents.commands import EXAMPLES

LINES = [(name, line) for name, lines in EXAMPLES.items() for line in lines.split("\n")[1:]]


def test_the_help_folds_the_flags_of_the_environment(capsys):
    for asked in ("--help", "--env-help"):
        with pytest.raises(SystemExit):
            parse(["compare", asked])
        text = capsys.readouterr().out
        shown = set(re.findall(r"--[\w-]+", text))
        assert "--env" in shown
        assert ("--tau" in shown) == (asked == "--env-help")
        assert ("--episodes" in shown) == (asked == "--help")
        assert ("--env-help" in shown) == (asked == "--help")


@pytest.mark.parametrize(("name", "line"), LINES, ids=[line for _, line in LINES])
def test_an_example_is_a_command_that_parses(name, line):
    program, *arguments = shlex.split(line, comments=True)
    assert program == "hybridtrack"
    if arguments[-1] in ("--help", "--version"):
        return
    command = parse(arguments)
    assert isinstance(command, command_class(name or arguments[0]))
    assert replace(command) == command
