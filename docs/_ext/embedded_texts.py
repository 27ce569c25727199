"""Make pages of the site of Markdown that can also be read on a forge.

`<!-- file CONTRIBUTING.md -->` becomes that file of the repository, with links to pages of the
site; `<!-- frame episode.html -->` above a picture becomes a frame that shows this file of the site
in place of the picture. Links to the README of a study and to the file of an example become links
to their pages.
"""

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
MARK = re.compile(r"^<!-- file ([\w./-]*) -->$", re.MULTILINE)
FRAME = re.compile(r"^<!-- frame (\S+) -->\n!\[(.*)\]\(.*\)$", re.MULTILINE)
# Of the repository, and the page of the site.
PAGES = {
    r"\]\(((?:\.\./)*)\.\./studies/(\w+)/README\.md": r"](\1studies/\2.md",
    r"\]\(\.\./CHANGELOG\.md": "](changelog.md",
    r"\]\(((?:\.\./)*)examples/(example_\w+)\.py": r"](\1gallery/\2.rst",
}


def file(name: str) -> str:
    """A Markdown file of the repository's root; its links to files that are no pages become
    text.
    """
    text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
    for page in ("CHANGELOG", "CONTRIBUTING", "SECURITY"):
        text = text.replace(f"]({page}.md)", f"]({page.lower()}.md)")
    return re.sub(r"\[([^\]]+)\]\((LICENSE|CITATION\.cff)\)", r"\1", text)


def embed(app: Any, page: str, source: list[str]) -> None:
    """Replace the marks of a page; a handler of Sphinx's event `source-read`."""
    text = MARK.sub(lambda mark: file(mark[1]), source[0])
    for link, site in PAGES.items():
        text = re.sub(link, site, text)
    source[0] = FRAME.sub(r'<iframe src="\1" title="\2" loading="lazy"></iframe>', text)


def embed_study(app: Any, path: Path, page: str, source: list[str]) -> None:
    """Replace the links of the README of a study to other studies; a handler of Sphinx's event
    `include-read`.
    """
    source[0] = re.sub(r"\]\(\.\./(\w+)/README\.md", r"](../../docs/studies/\1.md", source[0])


def outdated(app: Any, env: Any, *pages: Any) -> list[str]:
    """Pages with marks, which are always read again; a handler of Sphinx's event
    `env-get-outdated`.
    """
    return [
        page for page in env.found_docs if MARK.search(Path(env.doc2path(page)).read_text("utf-8"))
    ]


def setup(app: Any) -> dict[str, bool]:
    """Register the handlers."""
    app.connect("source-read", embed)
    app.connect("include-read", embed_study)
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
