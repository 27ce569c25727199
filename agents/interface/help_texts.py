"""Help texts of the commands: paragraphs without line breaks, true defaults, examples."""

import dataclasses
import functools
import shutil
import textwrap
import typing
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import tyro
from docstring_parser import parse_from_object

# Title of the group of the flags of the environment, and the flag that lists them.
ENVIRONMENT = "environment"
ENV_HELP = "--env-help"


def shown_default(text: str, help: str | None = None) -> Any:
    """Annotation of a flag whose value is None or empty by default: the text stands for it in
    the help. `help` describes a flag without a docstring.
    """
    return tyro.conf.arg(help=help, help_behavior_hint=f"(default: {text})")


def parse_flags(kind: Any, program: str, arguments: Sequence[str]) -> Any:
    """Return a dataclass with the flags of a command line.

    `GROUPS` of the dataclass are the boxes of its help: the names of their flags by title. The
    flags of the environment, but `--env`, are no part of it: `--env-help` prints them.
    """
    asks_help = not {"-h", "--help"}.isdisjoint(arguments)
    # tyro does not wrap them, and joins lines that do not begin with a space.
    wrapped = textwrap.TextWrapper(
        shutil.get_terminal_size().columns, initial_indent=" ", subsequent_indent=" "
    )
    lines = description(kind.__doc__).split("\n\n")
    values = vars(
        tyro.cli(
            grouped(kind, asks_help),
            prog=program,
            args=arguments,
            description="\n".join(map(wrapped.fill, lines)),
            # A flag is left out, not given as "None".
            config=(tyro.conf.DisallowNone,),
        )
    )
    for title in _groups(kind):
        values |= vars(values.pop(title))
    return kind(**values)


def description(docstring: str | None) -> str:
    """Return the docstring of a command as paragraphs without line breaks."""
    return "\n\n".join(" ".join(text.split()) for text in (docstring or "").split("\n\n"))


@functools.cache
def grouped(kind: Any, only_usual: bool = False) -> Any:
    """Return a dataclass for `tyro.cli` whose fields are the flags without a group, and for each
    group a dataclass of its flags; `only_usual` is without the flags of the environment.
    """
    groups, hints = _groups(kind), _shown_flags(kind)
    flags: dict[str, list[Any]] = {title: [] for title in ("", *groups)}
    titles = {name: title for title, names in groups.items() for name in names}
    fields = {field.name: field for field in dataclasses.fields(kind)}
    # Within a group in its order.
    for name in dict.fromkeys((*titles, *fields)):
        title, hint, field = titles.get(name, ""), hints[name], fields[name]
        if only_usual and title == ENVIRONMENT and name != "env":
            # Neither shown nor parsed.
            hint = Annotated[hint, tyro.conf.Suppress]
        default = dataclasses.field(default=field.default, default_factory=field.default_factory)
        flags[title].append((field.name, hint, default))
    boxes = flags.pop("")
    folded = f"{ENV_HELP} lists its options with their defaults."
    for title, inner in flags.items():
        text = folded if title == ENVIRONMENT else ""
        box = dataclasses.make_dataclass(title, inner, kw_only=True)
        boxes.append((title, Annotated[box, tyro.conf.arg(help=text)], dataclasses.field()))
    return dataclasses.make_dataclass(kind.__name__, boxes, kw_only=True)


@functools.cache
def field_texts(kind: type) -> dict[str, str]:
    """Return the descriptions in the docstrings of a class and its bases, each in one line, by the
    name of the field.
    """
    texts: dict[str, str] = {}
    if kind is not object:
        for base in reversed(kind.__bases__):
            texts |= field_texts(base)
        params = parse_from_object(kind).params
        texts |= {part.arg_name: " ".join((part.description or "").split()) for part in params}
    return texts


def _groups(kind: Any) -> Mapping[str, Sequence[str]]:
    return getattr(kind, "GROUPS", {})


def _shown_flags(kind: Any) -> dict[str, Any]:
    """Return the types of the flags, with the lines of each docstring joined, the rules named,
    and no default where there is none.

    "{announced}" and "{unknown}" in a docstring stand for the names of
    the rules of a task.
    """
    # The rules load slowly; a command that does not exist is refused without them.
    from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules

    texts = field_texts(kind)
    for task in (ANNOUNCED, UNKNOWN):
        names = ", ".join(f"'{name}'" for name in rules(task))
        texts = {flag: text.replace(f"{{{task}}}", names) for flag, text in texts.items()}
    hints = typing.get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        settings = getattr(hints[field.name], "__metadata__", ())
        known = any(getattr(part, "help_behavior_hint", None) is not None for part in settings)
        hint = None
        # The text of such a flag says what happens without it.
        if field.default in (None, ()) and not known:
            hint = ""
        elif isinstance(field.default, bool):
            hint = f"(default: {'on' if field.default else 'off'})"
        # The name of a flag does not begin with that of its group.
        added = tyro.conf.arg(
            help=texts.get(field.name), help_behavior_hint=hint, prefix_name=False
        )
        hints[field.name] = Annotated[hints[field.name], added]
    return hints
