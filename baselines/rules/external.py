"""Deciders from outside the package: functions, classes and objects in Python, files, modules and
entry points.
"""

import contextlib
import copy
import functools
import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from gymnasium.error import InvalidAction

from baselines.rules.decider import Actions, Answer, Decider
from hybrid_env.checks import (
    ArgumentError,
    BoolArray,
    check_flag,
    check_number,
    reject,
)

# Group of entry points by which packages name deciders.
ENTRY_POINTS = "hybridtrack.deciders"
FILTER_OPTIONS = ("bank", "evidence", "follow", "reset_covariance", "likelihood", "hazard")
"""Options that a decider may ask for: those of the filters, which leave the object and its
measurements as they are.
"""


class ModelDecider(Decider):
    """An object with Stable-Baselines3's `predict`, or a function of rows (N, width) to actions
    (N,), as a decider.
    """

    def __init__(self, model: Any):
        self.model = model
        self.call = getattr(model, "predict", model)
        self._rows_only = not _accepts_state(self.call)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: BoolArray | None = None,
        deterministic: bool = True,
    ) -> Answer:
        """See `Decider.predict`; a model that returns actions only has no state."""
        further = {
            "state": state,
            "episode_start": episode_start,
            "deterministic": deterministic,
        }
        answer = self.call(observation, **({} if self._rows_only else further))
        return answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, None)


def as_decider(model: Any) -> Decider:
    """Return a decider, any object with its `predict`, or a function of the observations, as a
    decider.
    """
    if isinstance(model, Decider):
        return model
    if isinstance(model, type) or not callable(getattr(model, "predict", model)):
        raise reject(
            "decider",
            model,
            "an object with a method predict, or a function of the observations",
        )
    return ModelDecider(model)


class CheckedDecider:
    """Asks a decider for actions, and checks those of a decider that is not of this package."""

    def __init__(self, decider: Decider, action_count: int):
        self.decider = decider
        self.action_count = action_count
        ours = type(decider).__module__.startswith(("agents.", "baselines."))
        self._trusted = ours and not isinstance(decider, ModelDecider)

    def __call__(self, seen: Any, state: Any, starts: BoolArray) -> Answer:
        """Return actions (N,) and the new state, see `Decider.predict`."""
        if self._trusted:
            return self.decider.predict(seen, state, starts, deterministic=True)
        with _one_line(self.decider):
            actions, state = self.decider.predict(seen, state, starts, deterministic=True)
            array = np.asarray(actions)
        return self._checked(array, len(seen)), state

    def observe(self, tracks: Any) -> Any:
        """Return what the decider observes of the arrays of an environment, see
        `Decider.observe`.
        """
        with _one_line(self.decider):
            return self.decider.observe(tracks)

    def _checked(self, array: Any, tracks: int) -> Actions:
        shown: Any = f"{array.dtype} of shape {array.shape}"
        if array.shape == (tracks,) and array.dtype.kind in "iu":
            shown = array[(array < 0) | (array >= self.action_count)]
            if not shown.size:
                return array
        place = where_defined(self.decider)
        raise reject(
            "actions",
            shown,
            f"{tracks} integers from 0 to {self.action_count - 1} from {place}",
        )


def find_external(name: str) -> Any:
    """Return the object of "mine.py:MyRule", "package.module:Rule" or an entry point; None for
    another form.
    """
    points = entry_points(group=ENTRY_POINTS)
    point = next((point for point in points if point.name == name), None)
    where, colon, attribute = name.rpartition(":")
    if point is None and not (colon and attribute.isidentifier() and _is_source(where)):
        return None
    place = name if point is not None else where
    with _one_line(place):
        return _load(where, attribute) if point is None else point.load()


def entry_point_names() -> list[str]:
    """Return the names of the deciders of installed packages."""
    return sorted(point.name for point in entry_points(group=ENTRY_POINTS))


def external_decider(model: Any, name: str, options: Any) -> Decider:
    """Return an object of a user as a decider, for the options of an environment, at its default
    threshold.

    With an attribute `thresholds` it is swept: a class is created with a threshold, a function
    called with it as its second argument, and an object gets it as `threshold`. `default`, `title`,
    `symbol`, `task`, `options` and `oracle` are read if they exist, see `Decider`; one that asks
    for the oracle bank is one. The name is for messages.

    Raises:
        ArgumentError: an attribute is not allowed.
    """
    with _one_line(name):
        attributes = _attributes(model, name, options)
    # A decider of this package is at the threshold that it was created with.
    created_at = vars(model).get("threshold") if isinstance(model, Decider) else None
    threshold = attributes["default"] if created_at is None else created_at
    return _create(model, name, options, attributes, threshold)


def _attributes(model: Any, name: str, options: Any) -> dict[str, Any]:
    """Return the checked attributes of a user's decider."""
    task = getattr(model, "task", options.switches)
    if task != options.switches:
        raise reject(
            "decider",
            name,
            f"one for {options.switches} switches; this one is for {task}",
        )
    thresholds = _thresholds(model, name)
    default = _default(model, name, thresholds)
    title = getattr(model, "title", "") or name_of(model)
    symbol = getattr(model, "symbol", "") or Decider.symbol
    needs = checked_options(model, name, type(options))
    if needs:
        # Checks the values.
        replace(options, **needs)
    oracle = check_flag("oracle", getattr(model, "oracle", False))
    if needs.get("bank") == "oracle":
        oracle = True
        title = title if "true anchor" in title else f"{title}, true anchor"
    return {
        "task": task,
        "title": title,
        "symbol": symbol if thresholds else "",
        "thresholds": thresholds or (0.0,),
        "default": default,
        "options": needs,
        "oracle": oracle,
        # It is created at one threshold.
        "sweeps": False,
    }


def _create(
    model: Any,
    name: str,
    options: Any,
    attributes: Mapping[str, Any],
    threshold: float,
) -> Decider:
    """Return a user's decider at a threshold."""
    swept = attributes["symbol"] != ""
    with _one_line(name):
        created = model
        if isinstance(model, type):
            first = (options,) if getattr(model, "reads_options", False) else ()
            created = model(*first, threshold) if swept else model(*first)
        elif swept and hasattr(model, "predict"):
            created = model.at(threshold) if isinstance(model, Decider) else copy.copy(model)
            created.threshold = threshold
        elif swept:
            # The threshold is its second argument.
            created = functools.update_wrapper(lambda rows: model(rows, threshold), model)
        decider = as_decider(created)
    create_at = functools.partial(_create, model, name, options, attributes)
    return decider.changed(**attributes, threshold=threshold, create_at=create_at)


def checked_options(model: Any, name: str, kind: type) -> dict[str, Any]:
    """Return the options of the class `kind` that a user's decider asks for; refuse others than
    `FILTER_OPTIONS`.
    """
    needs = getattr(model, "options", {})
    known = [option for option in FILTER_OPTIONS if hasattr(kind, option)]
    if not isinstance(needs, Mapping) or not all(option in known for option in needs):
        raise reject("options", needs, f"a mapping with some of {', '.join(known)} in {name}")
    return dict(needs)


def _thresholds(model: Any, name: str) -> tuple[float, ...]:
    given = getattr(model, "thresholds", ())
    try:
        thresholds = tuple(check_number("thresholds", number) for number in given)
    except TypeError:
        raise reject("thresholds", given, f"a sequence of numbers in {name}") from None
    return thresholds


def _default(model: Any, name: str, thresholds: tuple[float, ...]) -> float:
    """Return the default threshold: the attribute if there is one, else that in the middle."""
    given = getattr(model, "default", None)
    if given is not None:
        check_number("default", given, f"a number in {name}")
    if not thresholds:
        return 0.0
    if given in thresholds:
        return float(given)
    inherited = issubclass(model if isinstance(model, type) else type(model), Decider)
    if given is not None and not inherited:
        raise reject("default", given, f"one of the thresholds in {name}")
    return thresholds[len(thresholds) // 2]


def where_defined(model: Any) -> str:
    """Return class or function, file and line of a decider, for messages."""
    code = _code(model)
    title = name_of(model)
    return (
        title
        if code is None
        else f"{title}, {Path(code.co_filename).name} line {code.co_firstlineno}"
    )


def name_of(model: Any) -> str:
    """Return the name of a user's class or function, for messages."""
    inner = model.model if isinstance(model, ModelDecider) else model
    return str(getattr(inner, "__name__", type(inner).__name__))


def _code(model: Any) -> Any:
    """Return the code object of the function that decides; None for compiled code."""
    if isinstance(model, ModelDecider):
        call = model.call
    else:
        call = model.predict if type(model).decide is Decider.decide else model.decide
    call = call if inspect.isroutine(call) else getattr(call, "__call__", call)  # noqa: B004
    return getattr(inspect.unwrap(call), "__code__", None)


@contextlib.contextmanager
def _one_line(decider: Any) -> Iterator[None]:
    """Turn what a user's code raises into an error of one line: decider, file, line, what
    happened. It may not end the program either.
    """
    try:
        yield
    except (ArgumentError, InvalidAction):
        raise
    except (Exception, SystemExit) as error:
        name, code = decider, None
        if not isinstance(decider, str):
            name, code = name_of(decider), _code(decider)
        hidden = (__file__, importlib.__file__, contextlib.__file__, "<frozen")
        frames = traceback.extract_tb(error.__traceback__)
        outside = [frame for frame in frames if not frame.filename.startswith(hidden)]
        inside = [frame for frame in outside if code and frame.filename == code.co_filename]
        place = "".join(
            f" in {Path(frame.filename).name} line {frame.lineno}"
            for frame in (inside or outside)[-1:]
        )
        raise ArgumentError(
            f"decider {name} failed{place}: {type(error).__name__}: {error}"
        ) from error


def _accepts_state(function: Any) -> bool:
    """Return whether a function has an argument `state`."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        # Compiled code.
        return False
    return any(each.name == "state" or each.kind is each.VAR_KEYWORD for each in parameters)


def _is_source(where: str) -> bool:
    """Return whether a text is the path of a Python file, or a module."""
    if where.endswith(".py"):
        return True
    if not all(part.isidentifier() for part in where.split(".")):
        return False
    _search(Path.cwd())
    return "." in where or importlib.util.find_spec(where) is not None


def _search(folder: Path) -> None:
    """Let modules of a folder be imported, as `python` does with the present one."""
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _load(where: str, attribute: str) -> Any:
    """Return an attribute of a Python file or a module."""
    if not where.endswith(".py"):
        return getattr(importlib.import_module(where), attribute)
    path = Path(where).resolve()
    if not path.is_file():
        raise reject("decider", f"{where}:{attribute}", "a file that exists")
    content = hashlib.sha256(str(path).encode())
    for source in sorted(path.parent.glob("*.py")):
        content.update(source.read_bytes())
    return getattr(_import_file(path, content.hexdigest()), attribute)


@functools.cache
def _import_file(path: Path, version: str) -> ModuleType:
    """Import a Python file as `python` runs it, anew for every version of the sources beside it.

    The modules beside it are imported for this file alone, so that files in two folders may have
    helper modules of the same name.
    """
    name = f"decider_{version[:12]}"
    module = ModuleType(name)
    module.__file__ = str(path)
    # Dataclasses look their module up.
    sys.modules[name] = module
    before = set(sys.modules)
    writes = sys.dont_write_bytecode
    sys.path.insert(0, str(path.parent))
    # Cached bytecode may be that of another version of the same second.
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    finally:
        sys.dont_write_bytecode = writes
        sys.path.remove(str(path.parent))
        for helper in set(sys.modules) - before:
            file = getattr(sys.modules[helper], "__file__", None) or ""
            if Path(file).is_relative_to(path.parent):
                del sys.modules[helper]
    # For imports in functions.
    _search(path.parent)
    return module
