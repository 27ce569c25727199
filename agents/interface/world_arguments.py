"""Environment options as command-line flags, shared by all commands that create an environment."""

import contextlib
import dataclasses
import os
import re
import typing
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agents.interface.help_texts import ENVIRONMENT, field_texts, shown_default
from hybrid_env.checks import declared_fields, reject, unknown
from hybrid_env.json_files import read_json
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import ENVIRONMENTS, environment_options

CARD = "policy.json"
# Environment variable: 1 lets policies of others be unpickled, which runs the code in them.
TRUST = "HYBRIDTRACK_TRUST"
DEFAULT_ENV = "hybrid_env:HybridTrack-v0"


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        numbers = [f"{number:g}" for number in value]
        return " ".join(numbers if len(numbers) < 5 else [*numbers[:2], "...", numbers[-1]])
    return f"{value:g}" if isinstance(value, float) else str(value)


def options_table(env_id: str) -> Table:
    """Return the options of a registered id with their defaults, and the first sentence of the
    description of each.
    """
    kind: Any = environment_options(env_id)
    own = ENVIRONMENTS[env_id.rpartition(":")[2]]
    table = Table(title=f"Options of {env_id}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("option", no_wrap=True)
    table.add_column(overflow="fold")
    table.add_column("default", max_width=18, overflow="fold")
    for field in dataclasses.fields(kind):
        text = field_texts(kind)[field.name].partition(". ")[0].rstrip(".")
        default = own.get(field.name, field.default)
        flag = f"--{field.name.replace('_', '-')}"
        table.add_row(flag, escape(text), "none" if default in (None, ()) else _text(default))
    return table


def print_options(arguments: Sequence[str]) -> None:
    """Print the options of the environment that a command line names, by `--env` or by a run
    folder, or of the default one.
    """
    given = re.search(r"--env[= ](\S+)", " ".join(arguments))
    cards = filter(None, map(read_card, arguments))
    env_id = given[1] if given else next(cards, (DEFAULT_ENV, {}))[0]
    console = Console()
    with console.capture() as captured:
        console.print(options_table(env_id))
    print(captured.get(), end="")


def _flags() -> dict[str, Any]:
    """Return the types of all flags by name; those of the options follow from their dataclasses."""
    text = "Registered id of the environment. A run folder has by default the one of its training."
    flags: dict[str, Any] = {"env": Annotated[str | None, shown_default(DEFAULT_ENV, help=text)]}
    for kind in (WorldOptions, QuickestOptions):
        hints = typing.get_type_hints(kind)
        for name in (field.name for field in dataclasses.fields(kind)):
            # A law is given as a text.
            plain = str if str in typing.get_args(hints[name]) else hints[name]
            if name == "sensors":
                plain = tuple[str, ...]
            flags.setdefault(name, plain | None)
    return flags


_Flags: Any = dataclasses.make_dataclass(
    "_Flags", [(name, kind, None) for name, kind in _flags().items()], kw_only=True
)


@dataclass(kw_only=True)
class WorldArguments(_Flags):
    """Flags of the environment options. Flags that are not given leave the defaults of the
    environment id.
    """

    # See `parse_flags`.
    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {ENVIRONMENT: tuple(_flags())}

    @property
    def env_id(self) -> str:
        """The given id, or the default."""
        return self.env or DEFAULT_ENV

    def world_options(self, env_id: str | None = None) -> dict[str, Any]:
        """Return the given options as keyword arguments of `gym.make`; refuse what the
        environment does not have.
        """
        env_id = env_id or self.env_id
        given = {
            flag.name: getattr(self, flag.name)
            for flag in dataclasses.fields(WorldArguments)
            if flag.name != "env" and getattr(self, flag.name) is not flag.default
        }
        for name in given.keys() - option_names(env_id):
            environment = env_id.rpartition(":")[2]
            allowed = f"no value, because {environment} has no such option"
            raise reject(name, given[name], allowed)
        return given

    def world_of(self, decider: str) -> tuple[str, dict[str, Any]]:
        """Environment id and options for a decider.

        A run folder brings those of its training; flags that are given override these options.
        """
        environment, trained = read_card(decider) or ("", {})
        if self.env not in (None, environment) or not environment:
            return self.env_id, self.world_options()
        trained.pop("actions", None)
        return environment, trained | self.world_options(environment)


# Whether policies of others may be unpickled while a command runs.
_TRUSTING: ContextVar[bool] = ContextVar("trusting", default=False)


def trusted() -> bool:
    """Return whether policies of others may be unpickled."""
    return _TRUSTING.get() or os.environ.get(TRUST) == "1"


@contextlib.contextmanager
def trusting(trust: bool) -> Iterator[None]:
    """Say whether policies of others may be unpickled in this process while the block runs."""
    token = _TRUSTING.set(trust)
    try:
        yield
    finally:
        _TRUSTING.reset(token)


@dataclass(kw_only=True)
class TrustArguments:
    """Flag of the commands that read policies of other libraries."""

    trust: bool = False
    """Unpickle model.zip, which runs the code in it; needed for networks of other than the usual
    layers.
    """


def read_card(decider: str) -> tuple[str, dict[str, Any]] | None:
    """Environment id and options on the card of a run folder, as "folder:threshold" too; None
    for others.
    """
    for name in filter(None, (decider, decider.rpartition(":")[0])):
        path = Path(name) / CARD
        if path.is_file():
            try:
                card = read_json(path)
                environment, options = card["environment"], dict(card["options"])
                others = options.keys() - option_names(environment)
            except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
                allowed = f"a folder with a complete {CARD} ({error})"
                raise reject("run", str(path.parent), allowed) from None
            for option in others:
                raise unknown("option", option, option_names(environment))
            return environment, options
    return None


def option_names(env_id: str) -> set[str]:
    """Return the names of the options of a registered id."""
    kind: Any = environment_options(env_id)
    return set(declared_fields(kind))
