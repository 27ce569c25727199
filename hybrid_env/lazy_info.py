"""An info dictionary whose arrays are made when one of them is first read."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_READ_AND_WRITTEN_BY = (
    "__getitem__", "__setitem__", "__delitem__", "__contains__", "__iter__", "__len__", "__reversed__",
    "__eq__", "__ne__", "__or__", "__ror__", "__ior__", "__repr__",
    "get", "keys", "values", "items", "copy", "pop", "popitem", "setdefault", "update", "clear",
)  # fmt: skip


class LazyInfo(dict[str, Any]):
    """A dictionary that fills itself when it is first used.

    Most callers of a vector environment's `step` never read `info`, and eight arrays with their masks would
    take as long as the step of eight tracks. The state that the arrays are made of is copied at once, so
    their values are those of the step that returned them, whenever they are read.

    Args:
        make: returns arrays of N tracks by key; called once at most. Each gets its mask, `_key`, of N True.
        made: further entries.
    """

    __slots__ = ("_made", "_make")

    def __init__(self, make: Callable[[], dict[str, NDArray[Any]]], made: dict[str, Any]):
        self._make: Callable[[], dict[str, NDArray[Any]]] | None = make
        self._made = made

    def fill(self) -> None:
        """Make the entries, if that has not been done."""
        if self._make is not None:
            arrays, self._make = self._make(), None
            mask = np.ones(len(arrays["tick"]), np.bool_)
            dict.update(self, arrays | {f"_{key}": mask for key in arrays} | self._made)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self.items()),)  # a plain dictionary for pickle and copy


def _filled_first(name: str) -> Callable[..., Any]:
    method = getattr(dict, name)

    def use(self: LazyInfo, *arguments: Any, **keywords: Any) -> Any:
        self.fill()
        return method(self, *arguments, **keywords)

    use.__name__, use.__doc__ = name, method.__doc__
    return use


for _name in _READ_AND_WRITTEN_BY:
    setattr(LazyInfo, _name, _filled_first(_name))
