"""Every command line of README, of the pages, of the studies and of the help texts is one that the
console accepts.
"""

import re
import shlex
from pathlib import Path

import pytest

from agents import commands
from agents.cli import parse
from agents.commands.train import Train
from agents.training.recipe import package_recipes

ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "studies").glob("*/README.md")),
]
# A command may go on in the next line of a page, after a backslash.
LINES = {
    match[1]: page
    for page in PAGES
    for match in re.finditer(
        r"^ *hybridtrack (\w+ .*)$", page.read_text("utf-8").replace("\\\n", " "), re.MULTILINE
    )
    if not match[1].startswith("has ")
}
EXAMPLES = re.findall(r"^hybridtrack (\w.*)$", "".join(commands.EXAMPLES.values()), re.MULTILINE)


def test_the_pages_have_commands():
    assert len(LINES) > 50


@pytest.mark.parametrize("line", [*LINES, *EXAMPLES])
def test_a_command_line_is_accepted(line):
    arguments = shlex.split(line, comments=True)
    if arguments[-1] == "--help":
        return
    command = parse(arguments)

    is_new = isinstance(command, Train) and command.resume is None
    if is_new and not command.recipe.startswith("results/"):
        assert command.recipe in package_recipes() or (ROOT / command.recipe).is_file()
