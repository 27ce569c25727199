"""Make pages of the site of Markdown that can also be read on a forge.

`<!-- file -->` above a link to a Markdown file becomes the text of that file, with links to pages
of the site; on a forge the link stands alone. The README of every study becomes a page.
`<!-- frame episode.html -->` above a picture becomes a frame that shows this file of the site in
place of the picture. Links to the README of a study and to the file of an example become links to
their pages. Wide pictures get a smallest width at which their text can be read. The outputs of the
examples show no notices of compilations, which depend on the machine. The links from a module's
source code to its documentation lead to the anchors that the pages of the reference have.
"""

import re
from pathlib import Path
from typing import Any

import imagesize

ROOT = Path(__file__).parents[2]
MARK = re.compile(r"^<!-- file -->\n\[.*\]\((\S+)\)$", re.MULTILINE)
FRAME = re.compile(r"^<!-- frame (\S+) -->\n!\[(.*)\]\(.*\)$", re.MULTILINE)
# Of the repository, and the page of the site.
PAGES = {
    r"\]\(((?:\.\./)*)\.\./studies/(\w+)/README\.md": r"](\1studies/\2.md",
    r"\]\(((?:\.\./)*)\.\./studies/README\.md": r"](\1studies/index.md",
    r"\]\(\.\./CHANGELOG\.md": "](changelog.md",
    r"\]\(((?:\.\./)*)examples/(example_\w+)\.py": r"](\1gallery/\2.rst",
}

NOTICE = re.compile(r"^    HybridTrack: compiling.*\n", re.MULTILINE)
EMPTY = re.compile(r"^\.\. rst-class:: \S+\n\n \.\. code-block:: none\n\n(?!    )", re.MULTILINE)
# The page is called as the name that it documents: the last part of its name begins the member.
BACK = re.compile(r"(api/generated/([\w.]*\.)(\w+)\.html#)[\w.]*?(\3\b[\w.]*\")")


def write_studies() -> None:
    """Write a page for the README of every study, and one for that of all, which include it."""
    pages = ROOT / "docs/studies"
    pages.mkdir(exist_ok=True)
    for readme in (ROOT / "studies").rglob("README.md"):
        path = readme.relative_to(ROOT).as_posix()
        name = "index" if readme.parent.name == "studies" else readme.parent.name
        text = f"```{{include}} ../../{path}\n:relative-docs: ../\n:relative-images:\n```\n"
        if name == "index":
            text += "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"
        page = pages / f"{name}.md"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def file(path: str) -> str:
    """The text of a Markdown file of the repository's root.

    Its links to files that are no pages become text.
    """
    text = (ROOT / Path(path).name).read_text(encoding="utf-8").replace("](docs/", "](")
    for page in ("CHANGELOG", "CONTRIBUTING", "SECURITY"):
        text = text.replace(f"]({page}.md)", f"]({page.lower()}.md)")
    return re.sub(r"\[([^\]]+)\]\((LICENSE|CITATION\.cff)\)", r"\1", text)


def embed(app: Any, page: str, source: list[str]) -> None:
    """Replace the marks of a page; a handler of Sphinx's event `source-read`."""
    text = MARK.sub(lambda mark: file(mark[1]), source[0])
    for link, site in PAGES.items():
        text = re.sub(link, site, text)
    if page.startswith("gallery/"):
        text = EMPTY.sub("", NOTICE.sub("", text))
    source[0] = FRAME.sub(r'<iframe src="\1" title="\2" loading="lazy"></iframe>', text)


def embed_study(app: Any, path: Path, page: str, source: list[str]) -> None:
    """Replace the links of the README of a study to other studies; a handler of Sphinx's event
    `include-read`.
    """
    source[0] = re.sub(r"\]\(((?:\.\./)?)(\w+)/README\.md", r"](\1../docs/studies/\2.md", source[0])


def mend_back_links(app: Any, page: str, template: str, context: Any, doctree: Any) -> None:
    """Replace the anchors of the links on a page of source code; a handler of Sphinx's event
    `html-page-context`.
    """
    if page.startswith("_modules/"):
        context["body"] = BACK.sub(r"\1\2\4", context["body"])


def widen_pictures(app: Any, page: str, template: str, context: Any, doctree: Any) -> None:
    """Give pictures that are wider than a column a smallest width, at which text of 10 pt has 9
    pixels or more; a handler of Sphinx's event `html-page-context`.
    """
    files = {shown: path for path, (_, shown) in app.env.images.items()}

    def widened(picture: re.Match[str]) -> str:
        width, _ = imagesize.get(Path(app.srcdir, files[picture[2]]))
        style = f' style="min-width: {0.72 * width:.0f}px"' if width > 480 else ""
        return picture[1] + style

    if "body" in context and not page.startswith(("gallery/", "notebooks/")):
        pictures = r'(<img [^>]*src="[^"]*_images/([^"]+)")'
        context["body"] = re.sub(pictures, widened, context["body"])


def outdated(app: Any, env: Any, *pages: Any) -> list[str]:
    """Pages with marks, which are always read again; a handler of Sphinx's event
    `env-get-outdated`.
    """
    return [
        page for page in env.found_docs if MARK.search(Path(env.doc2path(page)).read_text("utf-8"))
    ]


def setup(app: Any) -> dict[str, bool]:
    """Write the pages of the studies, and register the handlers."""
    write_studies()
    app.connect("source-read", embed)
    app.connect("include-read", embed_study)
    app.connect("env-get-outdated", outdated)
    app.connect("html-page-context", mend_back_links)
    app.connect("html-page-context", widen_pictures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
