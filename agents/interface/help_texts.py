"""Help texts of the commands: paragraphs without line breaks, true defaults, examples."""

import dataclasses
import functools
import typing
from typing import Annotated, Any

import tyro
from docstring_parser import parse_from_object

from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules


def shown_default(text: str, help: str | None = None) -> Any:
    """Annotation of a flag whose value is None or empty by default: the text stands for it in
    the help. `help` describes a flag without a docstring.
    """
    return tyro.conf.arg(help=help, help_behavior_hint=f"(default: {text})")


def as_command(kind: type) -> tuple[type, str]:
    """Return a dataclass as a command for `tyro.cli`, and its description."""
    _prepare_flags(kind)
    return kind, "\n\n".join(" ".join(text.split()) for text in (kind.__doc__ or "").split("\n\n"))


@functools.cache
def _prepare_flags(kind: type) -> None:
    """Join the lines of each flag's docstring, name the rules, and show no default where there
    is none.

    "{announced}" and "{unknown}" in a docstring stand for the names of
    the rules of a task.
    """
    texts: dict[str, str] = {}
    for base in reversed(kind.__mro__[:-1]):
        described = {flag.arg_name: flag.description for flag in parse_from_object(base).params}
        texts |= {flag: " ".join(text.split()) for flag, text in described.items() if text}
    for task in (ANNOUNCED, UNKNOWN):
        names = ", ".join(f"'{name}'" for name in rules(task))
        texts = {flag: text.replace(f"{{{task}}}", names) for flag, text in texts.items()}
    hints = typing.get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        settings = getattr(hints[field.name], "__metadata__", ())
        known = any(getattr(part, "help_behavior_hint", None) is not None for part in settings)
        hint = None
        # Of a flag that is not given the text says what happens without it.
        if field.default in (None, ()) and not known:
            hint = ""
        elif isinstance(field.default, bool):
            hint = f"(default: {'on' if field.default else 'off'})"
        added = tyro.conf.arg(help=texts.get(field.name), help_behavior_hint=hint)
        kind.__annotations__[field.name] = Annotated[hints[field.name], added]
