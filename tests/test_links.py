"""Every relative link of the pages leads to a file of the repository, and to a heading in it, as a
forge shows them.
"""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = (".", "docs", "docs/api", "docs/environments", "studies", "studies/*")
PAGES = sorted(page for folder in FOLDERS for page in ROOT.glob(f"{folder}/*.md"))
BLOCK = re.compile(r"^( *```).*?^\1$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(text: str) -> set[str]:
    """Return the anchors that a forge gives to the headings of a page."""
    names: list[str] = []
    for heading in re.findall(r"^#+ (.*)$", BLOCK.sub("", text), re.MULTILINE):
        shown = re.sub(r"\]\(.*?\)", "", heading).strip().lower()
        names.append(re.sub(r"[^\w\- ]", "", shown).replace(" ", "-"))
    counts = [names[:row].count(name) for row, name in enumerate(names)]
    return {f"{name}-{n}" if n else name for name, n in zip(names, counts, strict=True)}


def leads_somewhere(page: Path, link: str) -> bool:
    """Return whether a link of a page has a target."""
    path, _, anchor = unquote(link).partition("#")
    target = page.parent / path if path else page
    return target.exists() and (not anchor or anchor in anchors(target.read_text("utf-8")))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_links_of_a_page_lead_somewhere(page):
    links = LINK.findall(BLOCK.sub("", page.read_text("utf-8")))
    relative = [link for link in links if not re.match(r"[a-z]+:", link)]

    assert [link for link in relative if not leads_somewhere(page, link)] == []
