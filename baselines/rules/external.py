"""Deciders from outside the package: functions, classes and objects in Python, files, modules and
entry points.
"""

import contextlib
import copy
import functools
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from gymnasium.error import InvalidAction

from baselines.rules.decider import Answer, Decider
from hybrid_env.checks import ArgumentError, BoolArray, checked, reject


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
        further = {"state": state, "episode_start": episode_start, "deterministic": deterministic}
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
            "decider", model, "an object with a method predict, or a function of the observations"
        )
    return ModelDecider(model)


def ask(decider: Decider, action_count: int, seen: Any, state: Any, starts: BoolArray) -> Answer:
    """Return actions (N,) and the new state, see `Decider.predict`; those of a decider that is not
    of this package are checked.
    """
    ours = type(decider).__module__.startswith(("agents.", "baselines."))
    if ours and not isinstance(decider, ModelDecider):
        return decider.predict(seen, state, starts, deterministic=True)
    with _one_line(name_of(decider)):
        answer, state = decider.predict(seen, state, starts, deterministic=True)
        actions = np.asarray(answer)
    shown: Any = f"{actions.dtype} of shape {actions.shape}"
    if actions.shape == (len(seen),) and actions.dtype.kind in "iu":
        shown = actions[(actions < 0) | (actions >= action_count)]
        if not shown.size:
            return actions, state
    allowed = f"{len(seen)} integers from 0 to {action_count - 1}"
    raise reject("actions", shown, f"{allowed} from {name_of(decider)}")


def observed(decider: Decider, tracks: Any) -> Any:
    """Return what a decider observes of the arrays of an environment, see `Decider.observe`."""
    with _one_line(name_of(decider)):
        return decider.observe(tracks)


def names_code(name: str) -> bool:
    """Return whether a name has the form "mine.py:MyRule", or "package.module:Rule" of a package
    that exists, or is that of a file, for which `find_external` lists what it has.
    """
    where, attribute = _split(name)
    parts = where.split(".")
    if parts[-1] == "py" or not all(map(str.isidentifier, [*parts, attribute])):
        return parts[-1] == "py"
    with _importing_from_here():
        return importlib.util.find_spec(parts[0]) is not None


def find_external(name: str) -> Any:
    """Return the object of "mine.py:MyRule", "package.module:Rule" or an entry point; None for
    another form.
    """
    if point := installed_deciders().get(name):
        with _one_line(name):
            return point.load()
    if not names_code(name):
        return None
    where, attribute = _split(name)
    with _one_line(where):
        module = _module(where)
        if hasattr(module, attribute):
            return getattr(module, attribute)
        names = [
            key
            for key, value in vars(module).items()
            if callable(value) and getattr(value, "__module__", "") == module.__name__
        ]
        allowed = f"{where}:NAME with one of its functions or classes: {', '.join(names) or 'none'}"
        raise reject("decider", name, allowed)


def installed_deciders() -> dict[str, EntryPoint]:
    """Return the entry points by which installed packages name deciders."""
    points = entry_points(group="hybridtrack.deciders")
    return {point.name: point for point in sorted(points, key=lambda point: point.name)}


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
        allowed = f"one for {options.switches} switches; this one is for {task}"
        raise reject("decider", name, allowed)
    given = tuple(getattr(model, "thresholds", ()))
    thresholds = checked("thresholds", given, tuple[float, ...]) or (0.0,)
    # That of a class of this package may be inherited.
    default: Any = getattr(model, "default", None)
    if default not in thresholds:
        kind = model if isinstance(model, type) else type(model)
        if default is not None and not issubclass(kind, Decider):
            raise reject("default", default, f"one of the thresholds in {name}")
        default = thresholds[len(thresholds) // 2]
    title = getattr(model, "title", "") or name_of(model)
    needs = checked_options(model, name, type(options))
    # Checks the values.
    replace(options, **needs)
    oracle = checked("oracle", getattr(model, "oracle", False), bool)
    if needs.get("bank") == "oracle":
        oracle = True
        title = title if "true anchor" in title else f"{title}, true anchor"
    return {
        "task": task,
        "title": title,
        "symbol": (getattr(model, "symbol", "") or Decider.symbol) if given else "",
        "thresholds": thresholds,
        "default": float(default),
        "options": needs,
        "oracle": oracle,
        # An object is created at one threshold.
        "sweeps": False,
    }


def _create(
    model: Any, name: str, options: Any, attributes: Mapping[str, Any], threshold: float
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
        decider = as_decider(created).for_modes(options)
    at = functools.partial(_create, model, name, options, attributes)
    return decider.changed(**attributes, threshold=threshold, at=at)


def checked_options(model: Any, name: str, kind: type) -> dict[str, Any]:
    """Return the options of the class `kind` that a user's decider asks for: those of the filters,
    which leave the object and its measurements as they are. Refuse others.
    """
    needs = getattr(model, "options", {})
    of_filters = "bank", "evidence", "follow", "reset_covariance", "likelihood", "hazard"
    known = [option for option in of_filters if hasattr(kind, option)]
    if not isinstance(needs, Mapping) or not all(option in known for option in needs):
        raise reject("options", needs, f"a mapping with some of {', '.join(known)} in {name}")
    return dict(needs)


def name_of(model: Any) -> str:
    """Return the name of a user's class or function, for messages."""
    inner = model.model if isinstance(model, ModelDecider) else model
    return str(getattr(inner, "__name__", type(inner).__name__))


@contextlib.contextmanager
def _one_line(name: str) -> Iterator[None]:
    """Turn what a user's code raises into an error of one line: decider, file, line, what
    happened. It may not end the program either.
    """
    try:
        yield
    except (ArgumentError, InvalidAction, KeyboardInterrupt):
        raise
    except BaseException as error:
        hidden = (__file__, importlib.__file__, contextlib.__file__, "<frozen")
        frames = [
            frame
            for frame in traceback.extract_tb(error.__traceback__)
            if not frame.filename.startswith(hidden) and "site-packages" not in frame.filename
        ]
        place = "".join(
            f" in {Path(frame.filename).name} line {frame.lineno}" for frame in frames[-1:]
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


def _split(name: str) -> tuple[str, str]:
    """Return the module or file of a name, and the attribute; "" if only a file is named."""
    where, _, attribute = name.rpartition(":")
    return (name, "") if name.endswith(".py") else (where, attribute)


@contextlib.contextmanager
def _importing_from_here() -> Iterator[None]:
    """Let modules of the present folder be imported, for a module that the user names alone: what
    another library looks for later must not be found there.
    """
    here = str(Path.cwd())
    if here in sys.path:
        yield
        return
    sys.path.append(here)
    try:
        yield
    finally:
        sys.path.remove(here)


def _module(where: str) -> ModuleType:
    """Return a module, or that of a Python file in its present version."""
    if not where.endswith(".py"):
        with _importing_from_here():
            return importlib.import_module(where)
    path = Path(where).resolve()
    if not path.is_file():
        raise reject("decider", where, "a file that exists")
    return _import_file(path, tuple(map(Path.read_bytes, sorted(path.parent.glob("*.py")))))


@functools.cache
def _import_file(path: Path, sources: tuple[bytes, ...]) -> ModuleType:
    """Import a Python file as `python` runs it, anew for every version of the sources beside it.

    The modules beside it are imported for this file alone, so that files in two folders may have
    helper modules of the same name.
    """
    module = ModuleType(f"decider_{path.stem}_{abs(hash((path, sources)))}")
    module.__file__ = str(path)
    # Dataclasses look their module up.
    sys.modules[module.__name__] = module
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
    return module
