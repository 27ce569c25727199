"""The base class of every decider, classical or learned, and how one is found by its name."""

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import BoolArray, FloatArray
from hybrid_env.observation import Layout, QuickestLayout
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel, probability_panel

Observations = NDArray[np.float32]
Actions = NDArray[np.int64]

# Tasks: announced switches, unknown switches.
ANNOUNCED, UNKNOWN = "announced", "unknown"
# All subclasses of `Decider`, in the order of their definition.
DEFINED: list[type["Decider"]] = []


class Decider:
    """A decision rule with the `predict` signature of Stable-Baselines3, vectorised over tracks.

    A subclass with a `name` is found by that name in commands, tables and figures; nothing else
    lists it.

    Attributes:
        name, title: on the command line, empty for a decider that is not found by a name; in tables
            and figures.
        task: what it decides, `ANNOUNCED` or `UNKNOWN`.
        symbol, thresholds, default: of its threshold: those to sweep, in order of increasing
            decision time, and the one used when none is given.
        second_threshold: name of a further argument of the class, the number after the comma in
            "ate:0.001,0.01".
        options: of the environment that it needs, if they differ: another bank that follows the
            same object.
        colour, marker: in figures, "#rrggbb" and a Matplotlib marker; empty for any.
        observes: "rows" of the environment; "tracks" calls `observe` with the arrays of the
            environment.
        every_tick: it has filters of its own that predict, so it is also asked in ticks without a
            measurement.
        reads_options: its first argument are the options of the environment.
        informed: it is told what a user does not know, as a bound: the true anchor, the law of the
            durations.
    """

    name: ClassVar[str] = ""
    task: ClassVar[str] = ANNOUNCED
    title: ClassVar[str] = ""
    symbol: ClassVar[str] = "threshold"
    thresholds: ClassVar[tuple[float, ...]] = ()
    default: ClassVar[float] = 0.0
    second_threshold: ClassVar[str] = ""
    options: ClassVar[Mapping[str, Any]] = {}
    colour: ClassVar[str] = ""
    marker: ClassVar[str] = ""
    observes: Literal["rows", "tracks"] = "rows"
    every_tick: ClassVar[bool] = False
    reads_options: ClassVar[bool] = False
    informed: ClassVar[bool] = False

    def __init_subclass__(cls, **keywords: Any):
        super().__init_subclass__(**keywords)
        DEFINED.append(cls)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: BoolArray | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """Return the actions of N tracks for one step. A rule whose actions are never random has
        `decide` instead.

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

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Actions, Any]:
        """Return the actions (N,) and the new state; arguments as in `predict`."""
        raise NotImplementedError

    def observe(self, tracks: Any) -> NDArray[Any]:
        """Return what `predict` reads, (N, width), from the arrays of the environment."""
        return np.asarray(tracks.take_rows())

    def panel(self) -> EvidencePanel:
        """Return the panel in which `evidence` is drawn."""
        if self.task == ANNOUNCED:
            return posterior_panel("Kalman filters")
        return probability_panel("bank")

    def evidence(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return what is compared with the threshold for each hypothesis, (N, M); the state
        stays as it is.

        By default it is the posterior of the filters of the environment. Arguments as in `predict`.
        """
        if self.task == ANNOUNCED:
            values = np.exp(Layout.of_rows(observation).read(observation, "log_ratio"))
            return np.asarray(values / values.sum(-1, keepdims=True))
        return np.exp(QuickestLayout.of_rows(observation).read(observation, "log_probability"))

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """Return the state of the tracks selected by a mask (N,), or `NotImplemented` if none
        can be dropped.
        """
        return NotImplemented

    @classmethod
    def together(cls, deciders: Sequence[Self]) -> "SeveralThresholds | None":
        """Return one decider that computes for several thresholds what they share; None if
        nothing is.
        """
        return None

    @classmethod
    def maker(cls, options: Any) -> Callable[[float], "Decider"]:
        """Return a function from a threshold to the decider, for the options of an environment."""
        make: Any = cls
        return partial(make, options) if cls.reads_options else make

    @classmethod
    def family(cls, options: Any) -> "DeciderFamily":
        """Return the decider at any threshold, for the options of an environment."""
        return DeciderFamily(
            cls.title,
            cls.symbol,
            cls.thresholds,
            cls.default,
            cls.maker(options),
            options=dict(cls.options),
        )


class RowRule(Decider, ABC):
    """A decider without a state: its actions depend on the present rows only."""

    @abstractmethod
    def act(self, rows: Observations) -> Actions:
        """Return the actions (N,) for rows (N, width) of the environment."""

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Actions, None]:
        """See `Decider.decide`; only the rows are used."""
        return self.act(observation), None


class SeveralThresholds(Decider):
    """Deciders of one rule that are computed together; its actions are those of the first."""

    chosen: list[Actions]


@dataclass(frozen=True)
class DeciderFamily:
    """A decider with one threshold that trades decision time against errors; see `Decider`."""

    # Shown in tables.
    name: str
    symbol: str
    thresholds: tuple[float, ...]
    default: float
    # Creates the decider at a threshold.
    make: Callable[[float], Any]
    # Number M that the decider requires; None applies to any.
    hypotheses: int | None = None
    options: dict[str, Any] = field(default_factory=dict)


def rules(task: str) -> dict[str, type[Decider]]:
    """Return the classical rules of a task by name, in the order of their files."""
    package = importlib.import_module("baselines.rules")
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{package.__name__}.{module.name}")
    found = [kind for kind in DEFINED if kind.task == task and "name" in vars(kind) and kind.name]
    ours = [kind for kind in found if kind.__module__.startswith("baselines.")]
    return {kind.name: kind for kind in sorted(ours, key=lambda kind: kind.__module__)}
