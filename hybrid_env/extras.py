"""Optional dependencies: which extra brings a missing module, by the metadata of the installation."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata

DISTRIBUTION = "hybrid-track"
OTHER_NAMES = {
    "PIL": "pillow", "bluesky": "bluesky-simulator", "pygame": "pygame-ce", "sumo": "eclipse-sumo", "yaml": "pyyaml",
}  # fmt: skip
"""Distributions that are not called as their modules."""


class MissingExtraError(ModuleNotFoundError):
    """A module of an optional dependency is missing. The message is one line that says how to install it."""


@contextmanager
def explained() -> Iterator[None]:
    """Raise `MissingExtraError` in place of the error of a missing module that an extra brings."""
    try:
        yield
    except ModuleNotFoundError as error:
        extra = extra_of(error.name or "")
        if extra is None:
            raise
        raise MissingExtraError(
            f"{error.name} is missing: this needs the extra [{extra}]: pip install '{DISTRIBUTION}[{extra}]'",
            name=error.name,
        ) from None


def extra_of(module: str) -> str | None:
    """Return the first extra of pyproject.toml that brings a module; None if none does."""
    top = module.partition(".")[0]
    wanted = OTHER_NAMES.get(top, top).replace("_", "-").lower()
    try:
        requirements = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        return None
    found = (re.match(r"([\w.-]+).*\bextra == ['\"]([\w-]+)['\"]", line) for line in requirements)
    return next((one[2] for one in found if one and one[1].lower() == wanted), None)
