"""The project's description on a package index; everything else is in pyproject.toml.

README.md has links relative to the repository, which an index cannot follow. With a URL `Source` in
`[project.urls]` they become absolute, otherwise their text remains and pictures are left out.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
RELATIVE_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://)([^)\s]+)\)")


def description(text: str, source: str | None) -> str:
    """Return Markdown without relative links.

    Args:
        text: of README.md.
        source: URL of the repository's web page; None if there is none.
    """

    def absolute(link: re.Match[str]) -> str:
        picture, words, path = link.groups()
        if source is None:
            return "" if picture else words
        return (
            f"{picture}[{words}]({source.rstrip('/')}/{'raw' if picture else 'blob'}/HEAD/{path})"
        )

    return RELATIVE_LINK.sub(absolute, text)


if __name__ == "__main__":
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    setup(
        long_description=description(
            (ROOT / "README.md").read_text(encoding="utf-8"), project.get("urls", {}).get("Source")
        ),
        long_description_content_type="text/markdown",
    )
