"""The examples of the help texts parse."""

import re

import pytest

from agents.cli import parse


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
