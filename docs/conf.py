"""Configuration of the documentation site; `make docs` builds it."""

import contextlib
import io
import os
import sys
import warnings
from importlib.metadata import metadata
from importlib.metadata import version as installed_version
from pathlib import Path

from markupsafe import Markup

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]
os.environ["PYTHONPATH"] = str(HERE.parent)  # an example starts a study as a process
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures only, no window
os.environ["OMP_NUM_THREADS"] = "1"  # the networks are small
os.environ["COLUMNS"] = "100"  # width of the help texts

project = "HybridTrack"
copyright = "The HybridTrack authors"
version = release = installed_version("hybrid-track")

extensions = [
    "myst_nb",  # Markdown pages, and the notebook, which runs
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "embedded_texts",
]
exclude_patterns = ["_build", "_templates", "examples", "gallery/*.ipynb"]

myst_heading_anchors = 3
myst_fence_as_directive = ["math"]  # as a forge shows formulas
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

highlight_language = "text"
default_role = "literal"  # `name` in docstrings is code
suppress_warnings = ["ref.python"]  # several classes have an attribute such as position
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings state shapes and units
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_inherit_docstrings = False
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

templates_path = ["_templates"]
html_theme = "furo"
html_title = f"HybridTrack {release}"
urls = dict(url.split(", ", 1) for url in metadata("hybrid-track").get_all("Project-URL") or [])
html_baseurl = urls.get("Documentation", "")
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
copybutton_exclude = ".linenos, .gp, .go"

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/example_",
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "api/examples",
    "doc_module": ("hybrid_env", "baselines", "agents"),
    "show_signature": False,
    "download_all_examples": False,
    "capture_repr": (),
    "abort_on_example_error": True,
    "min_reported_time": 1000,
}

warnings.filterwarnings("ignore", message=".*non-interactive.*")


def setup(app):
    """Add the page of an episode, which runs after the other pages are built."""
    app.connect("build-finished", write_episode)
    app.connect("html-page-context", add_preview)


def add_preview(app, page, template, context, doctree):
    """Add what is shown of a link to a page (Open Graph)."""
    title = Markup(context.get("title", "")).striptags()
    tags = {"title": title, "type": "website", "site_name": project}
    tags["image"] = f"{html_baseurl}_images/track.png"
    shown = (f'<meta property="og:{name}" content="{text}">' for name, text in tags.items())
    context["metatags"] = context.get("metatags", "") + "".join(shown)


def write_episode(app, error):
    """Write the page that index.md shows in a frame; on a forge the picture stands in its place."""
    from agents.commands.play import Play

    if error is None and app.builder.format == "html":
        with contextlib.redirect_stdout(io.StringIO()):
            Play(out=Path(app.outdir) / "episode.html").run()
