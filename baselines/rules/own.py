"""Deciders that users bring: functions, classes and objects in Python, files, modules and entry
points.
"""

import contextlib
import copy
import functools
import importlib
import importlib.util
import inspect
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import InvalidAction

from baselines.rules import own_modules
from baselines.rules.decider import Actions, Decider, DeciderFamily
from baselines.rules.own_modules import file_digest, import_file, import_named, named_digest
from hybrid_env.checks import (
    ArgumentError,
    BoolArray,
    check_choice,
    check_flag,
    check_number,
    reject,
)

# Group of entry points by which packages name deciders.
ENTRY_POINTS = "hybridtrack.deciders"
# Seconds; above both the user is told.
SLOW_CALL, SLOW_TOTAL = 0.05, 20.0
OURS = ("agents.", "baselines.")
FILTER_OPTIONS = ("bank", "evidence", "follow", "reset_covariance", "likelihood", "hazard")
"""Options that a decider may ask for: those of the filters, which leave the object and its
measurements as they are.
"""
# Bank that is told where the object is; how titles name this.
ORACLE, TRUE_ANCHOR = "oracle", "true anchor"


class Adapted(Decider):
    """An object with Stable-Baselines3's `predict`, or a function of rows (N, width) to actions
    (N,), as a decider.
    """

    def __init__(self, model: Any):
        self.model = model
        self._call = getattr(model, "predict", model)
        self._rows_only = not _accepts(self._call, "state")

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: BoolArray | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """See `Decider.predict`; a model that returns actions only has no state."""
        if self._rows_only:
            answer = self._call(observation)
        else:
            answer = self._call(
                observation,
                state=state,
                episode_start=episode_start,
                deterministic=deterministic,
            )
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
    return Adapted(model)


class Asked:
    """Asks a decider for actions, and checks those of a decider that is not of this package."""

    def __init__(self, decider: Decider, action_count: int):
        self.decider, self.action_count = decider, action_count
        # Of `TypeDeclarations`.
        inner = getattr(decider, "decider", decider)
        self._trusted = type(inner).__module__.startswith(OURS) and not isinstance(inner, Adapted)
        self._seconds = 0.0
        self._calls = 0
        self._told = False

    def __call__(self, seen: Any, state: Any, starts: BoolArray) -> tuple[Actions, Any]:
        """Return actions (N,) and the new state, see `Decider.predict`; of a slow decider the
        user is told once.
        """
        if self._trusted:
            return self.decider.predict(seen, state, starts, deterministic=True)
        began = time.perf_counter()
        with _one_line(self.decider):
            actions, state = self.decider.predict(seen, state, starts, deterministic=True)
        self._watch(time.perf_counter() - began, len(seen))
        return self._checked(actions, len(seen)), state

    def observe(self, tracks: Any) -> Any:
        """Return what the decider observes of the arrays of an environment, see
        `Decider.observe`.
        """
        with _one_line(self.decider):
            return self.decider.observe(tracks)

    def _checked(self, actions: Any, tracks: int) -> Actions:
        try:
            array = np.asarray(actions)
        except ValueError:
            # Ragged.
            shown = actions
        else:
            shown = f"{array.dtype} of shape {array.shape}"
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

    def _watch(self, seconds: float, tracks: int) -> None:
        self._seconds, self._calls = self._seconds + seconds, self._calls + 1
        if self._told or self._seconds < SLOW_TOTAL or self._seconds < SLOW_CALL * self._calls:
            return
        self._told = True
        slow = (
            f"{where_defined(self.decider)} is slow: {self._seconds / self._calls:.2g} s a call for"
            f" {tracks} tracks"
        )
        warnings.warn(f"{slow}; rules on whole arrays take milliseconds", stacklevel=4)


def find_own(name: str) -> Any:
    """Return the object of "mine.py:MyRule", "package.module:Rule" or an entry point; None for
    another form.
    """
    point = _entry_point(name)
    where, colon, attribute = name.rpartition(":")
    if point is None and not (colon and attribute.isidentifier() and _is_source(where)):
        return None
    place = name if point is not None else where
    with _one_line(place):
        try:
            return _load(where, attribute) if point is None else _load_point(point)
        except AttributeError as error:
            if isinstance(error.__context__, ImportError) or (
                attribute and attribute in str(error)
            ):
                raise reject("decider", name, f"a name that {place} defines") from error
            raise


def own_digest(name: str) -> str | None:
    """Return the digest of the sources of a decider that `find_own` has found; None if it is not
    known.
    """
    point = _entry_point(name)
    where = name.rpartition(":")[0] if point is None else point.module
    return file_digest(Path(where).resolve()) if where.endswith(".py") else named_digest(where)


def own_names() -> list[str]:
    """Return the names of the deciders that installed packages bring."""
    return sorted(point.name for point in entry_points(group=ENTRY_POINTS))


def _entry_point(name: str) -> EntryPoint | None:
    return next((point for point in entry_points(group=ENTRY_POINTS) if point.name == name), None)


def own_family(model: Any, name: str, options: Any) -> DeciderFamily:
    """Return a user's decider at any threshold, for the options of an environment. With an
    attribute `thresholds` it is swept: a class is created with a threshold, a function called with
    it as its second argument, and an object gets it as `threshold`. `default`, `title`, `symbol`,
    `task`, `options` and `informed` are read if they exist, see `Decider`; one that asks for the
    oracle bank is informed. The name is for messages. Raises `ArgumentError` for an attribute that
    is not allowed.
    """
    with _one_line(name):
        return _family(model, name, options)


def _family(model: Any, name: str, options: Any) -> DeciderFamily:
    task = getattr(model, "task", options.switches)
    if task != options.switches:
        raise reject(
            "decider",
            name,
            f"one for {options.switches} switches; this one is for {task}",
        )
    rule = isinstance(model, type) and issubclass(model, Decider)
    thresholds = _thresholds(model, name)
    default = _default(model, name, thresholds)
    title = _text(model, "title", name) or name_of(model)
    symbol = _text(model, "symbol", name) or Decider.symbol
    check_choice("observes", getattr(model, "observes", Decider.observes), ("rows", "tracks"))
    needs = own_options(model, name, type(options))
    if needs:
        # Checks the values.
        replace(options, **needs)
    informed = check_flag("informed", getattr(model, "informed", False))
    if needs.get("bank") == ORACLE:
        informed, title = True, title if TRUE_ANCHOR in title else f"{title}, {TRUE_ANCHOR}"
    known = model.family(options) if rule and thresholds else None

    def make(threshold: float) -> Decider:
        with _one_line(name):
            made = model if known is None else known.make(threshold)
            if known is None and thresholds:
                made = _at_threshold(model, threshold)
            decider = as_decider(made() if isinstance(made, type) else made)
            if isinstance(decider, Adapted):
                decider.task = task  # type: ignore[misc]
            if informed:
                decider.informed = True  # type: ignore[misc]
        return decider

    if known is not None:
        return replace(known, name=title, make=make)
    return DeciderFamily(
        title,
        symbol if thresholds else "",
        thresholds or (0.0,),
        default,
        make,
        options=needs,
    )


def own_options(model: Any, name: str, kind: type) -> dict[str, Any]:
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
    if len(set(thresholds)) < len(thresholds):
        raise reject("thresholds", given, f"different numbers in {name}")
    return thresholds


def _default(model: Any, name: str, thresholds: tuple[float, ...]) -> float:
    """Return the default threshold: the attribute if there is one, else that in the middle."""
    given = getattr(model, "default", None)
    if given is not None:
        check_number("default", given, f"a number in {name}")
    if not thresholds:
        return 0.0
    inherited = isinstance(model, Decider) or (
        isinstance(model, type) and issubclass(model, Decider)
    )
    if given not in thresholds and given is not None and not inherited:
        raise reject("default", given, f"one of the thresholds in {name}")
    return float(given) if given in thresholds else thresholds[len(thresholds) // 2]


def _text(model: Any, attribute: str, name: str) -> str:
    """Return an attribute that is a text of one line; empty if there is none."""
    text = getattr(model, attribute, None)
    if text is not None and not (isinstance(text, str) and text.isprintable()):
        raise reject(attribute, text, f"a text of one line in {name}")
    return text or ""


def _at_threshold(model: Any, threshold: float) -> Any:
    if isinstance(model, type):
        return model(threshold)
    if hasattr(model, "predict"):
        one = copy.copy(model)
        one.threshold = threshold
        return one

    @functools.wraps(model)
    def at_threshold(observation: Any) -> Any:
        return model(observation, threshold)

    return at_threshold


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
    own = model.model if isinstance(model, Adapted) else model
    return str(getattr(own, "__name__", type(own).__name__))


def _code(model: Any) -> Any:
    """Return the code object of the function that decides; None for compiled code."""
    if isinstance(model, Adapted):
        call = model._call
    else:
        call = model.predict if type(model).decide is Decider.decide else model.decide
    call = call if inspect.isroutine(call) else getattr(call, "__call__", call)  # noqa: B004
    return getattr(inspect.unwrap(call), "__code__", None)


@contextlib.contextmanager
def _one_line(decider: Any) -> Iterator[None]:
    """Turn what a user's code raises into an error of one line. It may not end the program
    either.
    """
    try:
        yield
    except (ArgumentError, InvalidAction):
        raise
    except (Exception, SystemExit) as error:
        raise _failure(decider, error) from error


def _failure(decider: Any, error: BaseException) -> ArgumentError:
    """Return the error of one line for an exception in a user's code: decider, file, line, what
    happened.
    """
    frames = traceback.extract_tb(error.__traceback__)
    code = None if isinstance(decider, str) else _code(decider)
    hidden = (__file__, own_modules.__file__, importlib.__file__, contextlib.__file__, "<frozen")
    outside = [one for one in frames if not one.filename.startswith(hidden)]
    own = [one for one in outside if code is not None and one.filename == code.co_filename]
    places = [f" in {Path(one.filename).name} line {one.lineno}" for one in own or outside]
    name = decider if isinstance(decider, str) else name_of(decider)
    return ArgumentError(
        f"decider {name} failed{(places or [''])[-1]}: {type(error).__name__}: {error}"
    )


def _accepts(function: Any, name: str) -> bool:
    """Return whether a function has an argument of a name."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        # Compiled code.
        return False
    return any(one.name == name or one.kind is one.VAR_KEYWORD for one in parameters)


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
        _search(Path.cwd())
        return getattr(import_named(where), attribute)
    path = Path(where).resolve()
    if not path.is_file():
        raise reject("decider", f"{where}:{attribute}", "a file that exists")
    return getattr(import_file(path), attribute)


def _load_point(point: EntryPoint) -> Any:
    """Return the object that an entry point names."""
    import_named(point.module)
    return point.load()
