"""The base class of every decider, classical or learned, and the rules by their names."""

import copy
import importlib
import math
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import (
    AnyArray,
    BoolArray,
    Float32Array,
    FloatArray,
    IntArray,
    check_number,
    reject,
)
from hybrid_env.observation import Layout, QuickestLayout
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel, probability_panel

Observations = Float32Array
Actions = IntArray
# Actions, and the state for the next call.
Answer = tuple[Actions, Any]
# Attributes that differ by the further names of a class, see `Decider`.
Variants = Mapping[str, Mapping[str, Any]]

# Tasks: announced switches, unknown switches.
ANNOUNCED, UNKNOWN = "announced", "unknown"
# All subclasses of `Decider`, in the order of their definition.
DEFINED: list[type["Decider"]] = []


class Decider:
    """A decision rule with the `predict` signature of Stable-Baselines3, vectorised over tracks.

    It decides at one threshold; `at` returns it at another one. A subclass with a `name` is found
    by that name in commands, tables and figures; nothing else lists it.

    Attributes:
        name, title: on the command line, empty for a decider that is not found by a name; in tables
            and figures.
        task: what it decides, `ANNOUNCED` or `UNKNOWN`.
        threshold: the number that trades decision time for errors. With `sweeps` it may also be
            an array (K,); then the actions are (K, N), and their filters are computed once.
        symbol, thresholds, default: of its threshold: those to sweep, in order of increasing
            decision time, and the one used when none is given.
        bounds: smallest and largest threshold that is allowed.
        second_threshold: name of a further attribute and argument of the class, the number after
            the comma in "ate:0.001,0.01".
        options: of the environment that it needs, if they differ: another bank that follows the
            same object.
        variants: further names, each with the attributes that differ, and as "arguments" a function
            from the options of an environment to arguments of the class.
        hypotheses: number M that it requires; None applies to any.
        any_modes: it applies to all modes, not only to straight motion and the turns of `radii`.
        observes: "rows" of the environment; "tracks" calls `observe` with the arrays of the
            environment.
        every_tick: it has filters of its own that predict, so it is also asked in ticks without a
            measurement.
        reads_options: its first argument are the options of the environment.
        source: of its probabilities, in figures.
        oracle: it knows what a user does not know, as a bound: the true anchor, the law of the
            durations.
    """

    name: str = ""
    task: str = ANNOUNCED
    title: str = ""
    threshold: Any = 0.0
    symbol: str = "threshold"
    thresholds: tuple[float, ...] = ()
    default: float = 0.0
    bounds: tuple[float, float] = (-math.inf, math.inf)
    sweeps: bool = False
    second_threshold: str = ""
    options: Mapping[str, Any] = {}
    variants: ClassVar[Variants] = {}
    hypotheses: int | None = None
    any_modes: bool = True
    observes: Literal["rows", "tracks"] = "rows"
    every_tick: bool = False
    reads_options: bool = False
    source: str = "bank"
    oracle: bool = False

    def __init__(self, threshold: float | None = None):
        self.threshold = self.check_threshold(self.default if threshold is None else threshold)

    def __init_subclass__(cls, **keywords: Any):
        super().__init_subclass__(**keywords)
        DEFINED.append(cls)

    @classmethod
    def create(cls, options: Any, **arguments: Any) -> Self:
        """Return the decider for the options of an environment, at its default threshold."""
        return cls(*([options] if cls.reads_options else []), **arguments)

    def for_modes(self, options: Any) -> Self:
        """Return the decider for the modes of an environment; raise `ArgumentError` for those to
        which it does not apply. What looks a decider up calls it, and what rolls one out.
        """
        plane = not self.any_modes or (options.climbs and self.observes == "tracks")
        if options.modes is not None and plane:
            modes = ", ".join(map(str, options.modes))
            allowed = "straight motion, left and right turns of the same radii"
            raise reject("modes", modes, f"{allowed} for {self.title or type(self).__name__}")
        return self

    def at(self, threshold: ArrayLike) -> Self:
        """Return the decider at another threshold, or at several ones (K,), see `sweeps`.

        Raises:
            ArgumentError: the threshold is not allowed.
        """
        checked = [self.check_threshold(each) for each in np.atleast_1d(threshold).tolist()]
        return self.changed(threshold=np.array(checked) if np.ndim(threshold) else checked[0])

    def check_threshold(self, threshold: Any) -> float:
        """Return a threshold; raise `ArgumentError` for one that is not allowed."""
        bounded = np.isfinite(self.bounds).any()
        allowed = "a number from {:g} to {:g}" if bounded else "a finite number"
        return check_number(self.symbol, threshold, allowed.format(*self.bounds), *self.bounds)

    def changed(self, **attributes: Any) -> Self:
        """Return a copy with other attributes."""
        other = copy.copy(self)
        vars(other).update(attributes)
        return other

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: BoolArray | None = None,
        deterministic: bool = True,
    ) -> Answer:
        """Return the actions of N tracks for one step. A rule whose actions are never random has
        `decide` or `act` instead.

        Args:
            observation: (N, width) rows of the environment, see its docstring, or what `observe`
                returned.
            state: the state that the previous call returned; None at the first step.
            episode_start: (N,) True where an episode begins.
            deterministic: if False, a stochastic decider samples its actions.

        Returns:
            (N,) actions of the environment (in `HybridTrackEnv` 0 waits and i + 1 declares
            hypothesis i, in `HybridTrackQuickestEnv` i states hypothesis i) and the new state.
        """
        return self.decide(observation, state, episode_start)

    def decide(self, observation: Any, state: Any, episode_start: Any) -> Answer:
        """Return the actions (N,) and the new state; arguments as in `predict`. By default they
        depend on the present rows only, see `act`.
        """
        return self.act(observation), None

    def act(self, rows: Observations) -> Actions:
        """Return the actions (N,) for rows (N, width) of the environment."""
        raise NotImplementedError

    def observe(self, tracks: Any) -> AnyArray:
        """Return what `predict` reads, (N, width), from the arrays of the environment."""
        return tracks.take_rows()

    def panel(self) -> EvidencePanel:
        """Return the panel in which `evidence` is drawn."""
        if self.task == ANNOUNCED:
            return posterior_panel("Kalman filters")
        level = self.threshold if self.symbol == "probability" else 0.0
        return probability_panel(self.source, level)

    def evidence(
        self, observation: Any, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return what is compared with the threshold for each hypothesis, (N, M); the state
        stays as it is.

        By default it is the posterior of the filters of the environment. Arguments as in `predict`.
        """
        if self.task == ANNOUNCED:
            values = np.exp(Layout.of_rows(observation).read(observation, "log_ratio"))
            return values / values.sum(-1, keepdims=True)
        return np.exp(QuickestLayout.of_rows(observation).read(observation, "log_probability"))

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """Return the state of the tracks selected by a mask (N,), or `NotImplemented` if none
        can be dropped.
        """
        return NotImplemented


@dataclass(frozen=True)
class Rule:
    """A classical rule with a name: its class, and what differs from it, see
    `Decider.variants`.
    """

    kind: type[Decider]
    changes: Mapping[str, Any]

    def attribute(self, name: str) -> Any:
        """Return an attribute of the decider."""
        return self.changes.get(name, getattr(self.kind, name))

    def create(self, options: Any) -> Decider:
        """Return the decider for the options of an environment, at its default threshold."""
        attributes = dict(self.changes)
        arguments = attributes.pop("arguments", lambda options: {})
        return self.kind.create(options, **arguments(options)).changed(**attributes)


def rules(task: str) -> dict[str, Rule]:
    """Return the classical rules of a task by name, in the order of their files."""
    package = importlib.import_module("baselines.rules")
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{package.__name__}.{module.name}")
    named: dict[str, Rule] = {}
    for kind in sorted(DEFINED, key=lambda kind: kind.__module__):
        if kind.task == task and kind.__module__.startswith(f"{package.__name__}."):
            variants = {vars(kind).get("name", ""): {}, **vars(kind).get("variants", {})}
            named |= {
                name: Rule(kind, {"name": name, **changes})
                for name, changes in variants.items()
                if name
            }
    return named
