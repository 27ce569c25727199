"""Put texts of the code into Markdown pages, so that each is written once.

`<!-- docstring hybrid_env.HybridTrackEnv -->` becomes the docstring of a class, in Markdown as
Gymnasium's environments are documented; `<!-- help compare -->` becomes the output of `hybridtrack
compare --help`; `<!-- file CONTRIBUTING.md -->` becomes that file of the repository, with links to
pages of the site; `<!-- card announced/shipped -->` becomes a table of the card of shipped weights,
and the settings of their training.
"""

import contextlib
import hashlib
import importlib
import inspect
import io
import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
MARK = re.compile(r"^<!-- (docstring|help|file|card) ([\w./-]*) ?-->$", re.MULTILINE)


def docstring(path: str) -> str:
    """The docstring of a class; its headings are the sections of a page."""
    module, _, name = path.rpartition(".")
    text = inspect.getdoc(getattr(importlib.import_module(module), name))
    if text is None:
        raise ValueError(f"{path} has no docstring")
    return text


def help_text(command: str) -> str:
    """The help of a command as a code block."""
    from agents.cli import main

    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        main([command, "--help"])
    return f"```text\n{output.getvalue()}```"


def file(name: str) -> str:
    """A Markdown file of the repository's root; its links to files that are no pages become
    text.
    """
    text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
    for page in ("CHANGELOG", "CONTRIBUTING", "SECURITY"):
        text = text.replace(f"]({page}.md)", f"]({page.lower()}.md)")
    return re.sub(r"\[([^\]]+)\]\((LICENSE|CITATION\.cff)\)", r"\1", text)


def card(folder: str) -> str:
    """The card of shipped weights as a table, and the settings of their training as a code
    block.
    """
    import yaml
    from safetensors.numpy import load_file

    place = ROOT / "agents" / "learned" / "weights" / folder
    told = json.loads((place / "policy.json").read_text(encoding="utf-8"))
    weights = place / "policy.safetensors"
    numbers = sum(array.size for array in load_file(weights).values())
    digest = hashlib.sha256(weights.read_bytes()).hexdigest()
    settings = told["recipe"]["entry"]
    rows = {
        "weights": f"{numbers:,} numbers, {weights.stat().st_size:,} bytes",
        "SHA-256": f"`{digest}`",
    }
    rows["training"] = (
        f"recipe `{told['recipe']['name']}` from seed {told['seed']} in"
        f" `{told['environment']}`: {told['steps']:,} ticks in {told['seconds']:,.0f} s"
    )
    found = {key.partition("/")[2]: value for key, value in told["measured"].items() if "/" in key}
    names = {"sprt": "reward of ATE", "threshold": "reward of the threshold rule"}
    rows["at the end of training"] = ", ".join(
        f"{names.get(key, key.replace('_', ' '))} {value:.3f}" for key, value in found.items()
    )
    rows["versions"] = ", ".join(f"{name} {number}" for name, number in told["versions"].items())
    table = "\n".join(
        ["| | |", "|---|---|", *(f"| {name} | {text} |" for name, text in rows.items())]
    )
    shown = yaml.safe_dump(settings, sort_keys=False, default_flow_style=None)
    return f"{table}\n\n```yaml\n{shown}```"


def embed(app: Any, page: str, source: list[str]) -> None:
    """Replace the marks of a page; a handler of Sphinx's event `source-read`."""
    texts = {
        "docstring": docstring,
        "help": help_text,
        "file": file,
        "card": card,
    }
    source[0] = MARK.sub(lambda mark: texts[mark[1]](mark[2]), source[0])


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
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
