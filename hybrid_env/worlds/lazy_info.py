"""An info dictionary whose arrays are created on first access."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_DICT_METHODS = (
    "__getitem__", "__setitem__", "__delitem__", "__contains__", "__iter__", "__len__", "__reversed__",
    "__eq__", "__ne__", "__or__", "__ror__", "__ior__", "__repr__",
    "get", "keys", "values", "items", "copy", "pop", "popitem", "setdefault", "update", "clear",
)  # fmt: skip


class LazyInfo(dict[str, Any]):
    """A dictionary that is filled on first access.

    Most callers of a vector environment's `step` never read `info`, and creating eight arrays with their
    masks takes as long as a step of eight tracks. The state is copied in the step, so the values are those of
    the step that returned the dictionary, whenever they are read.

    Code in C that reads the size of a dictionary directly, such as `json.dumps`, sees an empty one until the
    first use: pass it `dict(info)`. All masks of an info are one array.

    Args:
        make: returns arrays of N tracks by key; called at most once. Each key gets a mask `_key` of N True.
        made: further entries, already created.
    """

    __slots__ = ("_made", "_make")
    fromkeys = staticmethod(dict.fromkeys)  # type: ignore[assignment]

    def __init__(self, make: Callable[[], dict[str, NDArray[Any]]], made: dict[str, Any]):
        self._make: Callable[[], dict[str, NDArray[Any]]] | None = make
        self._made = made

    def fill(self) -> None:
        """Create the entries, unless they exist."""
        if self._make is not None:
            arrays, self._make = self._make(), None
            mask = np.ones(len(arrays["tick"]), np.bool_)
            dict.update(self, arrays | {f"_{key}": mask for key in arrays} | self._made)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self.items()),)  # pickled and copied as a plain dictionary


def _fill_first(name: str) -> Callable[..., Any]:
    method = getattr(dict, name)

    def wrapper(self: LazyInfo, *arguments: Any, **keywords: Any) -> Any:
        self.fill()
        return method(self, *arguments, **keywords)

    wrapper.__name__, wrapper.__doc__ = name, method.__doc__
    return wrapper


for _name in _DICT_METHODS:
    setattr(LazyInfo, _name, _fill_first(_name))
