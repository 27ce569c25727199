"""Environment options as command-line flags, shared by all commands that create an environment."""

import contextlib
import dataclasses
import os
import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from docstring_parser import parse

from agents.interface.help_texts import shown_default
from agents.interface.input_files import read_json
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import ENVIRONMENTS, environment_options

CARD = "policy.json"
# Environment variable: 1 lets policies of others be unpickled, which runs the code in them.
TRUST = "HYBRIDTRACK_TRUST"
DEFAULT_ENV = "hybrid_env:HybridTrack-v0"
_DEFAULT_TEXTS = {
    "heading": "random",
    "object_variance": "Q",
    "reset_covariance": "True for the published bank only",
    "hazard": "inverse of the mean duration",
    "sensors": "one of variance R",
}


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        numbers = [f"{number:g}" for number in value]
        return " ".join(numbers if len(numbers) < 5 else [*numbers[:2], "...", numbers[-1]])
    return f"{value:g}" if isinstance(value, float) else str(value)


def _flag(kind: type, field: dataclasses.Field[Any], hint: Any) -> Any:
    """Return the type of the flag of an option, with its description and its defaults."""
    # A law is given as a text.
    name, plain = field.name, str if str in typing.get_args(hint) else hint
    if name == "sensors":
        plain = tuple[str, ...]
    parts = [part for base in kind.__mro__ for part in parse(base.__doc__ or "").params]
    text = " ".join(next(str(part.description) for part in parts if part.arg_name == name).split())
    # For callers in Python.
    text = re.sub(r"[;.] None [^.;]*|, or a (?:law|scheme) object", "", text)
    only = "" if kind is WorldOptions else "HybridTrackQuickest-v0: "
    defaults = [_DEFAULT_TEXTS.get(name, _text(field.default))]
    defaults += [
        f"{_text(options[name])} in {env_id}"
        for env_id, options in ENVIRONMENTS.items()
        if name in options
    ]
    shown = shown_default("; ".join(defaults), help=only + text[0].upper() + text[1:])
    return Annotated[plain if plain is bool else plain | None, shown]


def _flags() -> dict[str, Any]:
    """Return the types of all flags by name; those of the options follow from their dataclasses."""
    text = "Registered id of the environment. A run folder has by default the one of its training."
    flags: dict[str, Any] = {"env": Annotated[str | None, shown_default(DEFAULT_ENV, help=text)]}
    for kind in (WorldOptions, QuickestOptions):
        hints = typing.get_type_hints(kind)
        for field in dataclasses.fields(kind):
            if field.name not in flags:
                flags[field.name] = _flag(kind, field, hints[field.name])
    return flags


_Flags: Any = dataclasses.make_dataclass(
    "_Flags",
    [(name, kind, False if kind.__origin__ is bool else None) for name, kind in _flags().items()],
    kw_only=True,
)


@dataclass(kw_only=True)
class WorldArguments(_Flags):
    """Flags of the environment options. Flags that are not given leave the defaults of the
    environment id.
    """

    @property
    def env_id(self) -> str:
        """The given id, or the default."""
        return DEFAULT_ENV if self.env is None else self.env

    def world_options(self, env_id: str | None = None) -> dict[str, Any]:
        """Return the given options as keyword arguments of `gym.make`; refuse what the
        environment does not have.
        """
        env_id = env_id or self.env_id
        values = [
            (flag, getattr(self, flag.name))
            for flag in dataclasses.fields(WorldArguments)
            if flag.name != "env"
        ]
        given = {flag.name: value for flag, value in values if value is not flag.default}
        # Refuses an unknown id.
        known = _names(env_id)
        for name in given:
            if name not in known:
                environment = env_id.rpartition(":")[2]
                raise reject(
                    name,
                    given[name],
                    f"no value, because {environment} has no such option",
                )
        return given

    def world_of(self, decider: str) -> tuple[str, dict[str, Any]]:
        """Environment id and options for a decider.

        A run folder brings those of its training; flags that are given override these options.
        """
        card = read_card(decider)
        if card is None or self.env not in (None, card["environment"]):
            return self.env_id, self.world_options()
        trained = {name: value for name, value in card["options"].items() if name != "actions"}
        return card["environment"], trained | self.world_options(card["environment"])


def trusted() -> bool:
    """Return whether policies of others may be unpickled."""
    return os.environ.get(TRUST) == "1"


@contextlib.contextmanager
def trusting(trust: bool) -> Iterator[None]:
    """Say whether policies of others may be unpickled in this process while the block runs."""
    before = os.environ.pop(TRUST, None)
    if trust:
        os.environ[TRUST] = "1"
    try:
        yield
    finally:
        os.environ.pop(TRUST, None)
        if before is not None:
            os.environ[TRUST] = before


@dataclass(kw_only=True)
class TrustArguments:
    """Flag of the commands that read policies of other libraries."""

    trust: bool = False
    """Unpickle model.zip, which runs the code in it; needed for networks of other than the usual
    layers.
    """


def read_card(decider: str) -> dict[str, Any] | None:
    """Environment id and options on the card of a run folder, as "folder:threshold" too; None
    for others.
    """
    names = (decider, decider.rpartition(":")[0])
    for path in (Path(name) / CARD for name in names if name):
        if path.is_file():
            try:
                card = read_json(path)
                environment = card["environment"]
                options = card["options"]
                if not isinstance(environment, str):
                    raise reject("environment", environment, "a registered id")
                if not isinstance(options, dict):
                    raise reject("options", options, "a mapping")
                for name in sorted(options.keys() - _names(environment)):
                    raise reject("option", name, "an option of the environment")
                return {"environment": environment, "options": options}
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise reject(
                    "run",
                    str(path.parent),
                    f"a folder with a complete {CARD} ({error})",
                ) from None
    return None


def _names(env_id: str) -> set[str]:
    return {field.name for field in dataclasses.fields(environment_options(env_id))}
