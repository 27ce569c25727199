"""Environment options as command-line flags, shared by all commands that create an environment."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from agents.interface.help_texts import shown_default
from agents.interface.input_files import read_json
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import ENVIRONMENTS, environment_options

CARD = "policy.json"
DEFAULT_ENV = "hybrid_env:HybridTrack-v0"
_FIELDS = {
    field.name: field for kind in (QuickestOptions, WorldOptions) for field in dataclasses.fields(kind)
}


_DEFAULT_TEXTS = {
    "heading": "random",
    "reset_covariance": "True for the published bank only",
    "hazard": "inverse of the mean duration",
}


def _default(name: str) -> Any:
    """Help text of the default of an option, in place of None."""
    texts = [_DEFAULT_TEXTS.get(name, _text(_FIELDS[name].default))]
    texts += [
        f"{_text(options[name])} in {env_id}" for env_id, options in ENVIRONMENTS.items() if name in options
    ]
    return shown_default("; ".join(texts))


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        numbers = [f"{number:g}" for number in value]
        return " ".join(numbers if len(numbers) < 5 else [*numbers[:2], "...", numbers[-1]])
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(kw_only=True)
class WorldArguments:
    """Flags of the environment options. Flags that are not given leave the defaults of the environment id."""

    env: Annotated[str | None, shown_default(DEFAULT_ENV)] = None
    """Registered id of the environment. A run folder has by default the one of its training."""
    scheme: Annotated[str | None, _default("scheme")] = None
    """Segments: 'random', 'random 6x50-100', 'L50r3 R75r5 S50', golubkov2018, tsyganov2019, golubkov2020."""
    radii: Annotated[tuple[float, ...] | None, _default("radii")] = None
    """Turn radii of the bank [m]."""
    speed: Annotated[float | None, _default("speed")] = None
    """Initial speed of the object [m/s]."""
    heading: Annotated[float | None, _default("heading")] = None
    """Initial heading of the object [rad]."""
    tau: Annotated[float | None, _default("tau")] = None
    """Duration of a tick [s]."""
    process_variance: Annotated[float | None, _default("process_variance")] = None
    """Process noise Q, the variance added to each velocity at every tick [m^2/s^2]."""
    measurement_variance: Annotated[float | None, _default("measurement_variance")] = None
    """Measurement noise R, the variance of a measured coordinate [m^2]."""
    noise: Annotated[str | None, _default("noise")] = None
    """Law of the measurement errors in units of sqrt(R): 'gaussian', 'outliers 0.02', 'levy 1.5 1 44' (index,
    scale, clip), 'student_t 3'. The bank does not know it."""
    missed: Annotated[float | None, _default("missed")] = None
    """Probability that a tick has no measurement."""
    likelihood: Annotated[str | None, _default("likelihood")] = None
    """Law of the innovations that the bank assumes: 'gaussian', or the robust 'student_t 4'."""
    delay_cost: Annotated[float | None, _default("delay_cost")] = None
    """Cost of a tick, relative to the reward of a correct decision."""
    correctness: Annotated[Literal["exact", "type"] | None, _default("correctness")] = None
    """What has to be correct: the exact hypothesis, or its type (straight, left or right)."""
    undecided: Annotated[Literal["likeliest", "keep"] | None, _default("undecided")] = None
    """Decision for a segment that ends undecided: the likeliest hypothesis, or the previous mode."""
    bank: Annotated[str | None, _default("bank")] = None
    """Filter bank: published, anchor_aware (with the uncertainty of the anchor), oracle (true anchor)."""
    reset_covariance: Annotated[bool | None, _default("reset_covariance")] = None
    """Reset the covariance to P := I at the start of every segment, as published."""
    follow: Annotated[Literal["declared", "bank"] | None, _default("follow")] = None
    """What runs on after a decision: the filter of the declared hypothesis, as published, or all filters,
    whose merged estimate is the next anchor."""
    ticks: Annotated[int | None, _default("ticks")] = None
    """Length of an episode of HybridTrackQuickest-v0 [ticks]."""
    durations: Annotated[str | None, _default("durations")] = None
    """Law of the durations of segments in HybridTrackQuickest-v0: '25 + geometric 50', 'geometric 75',
    'uniform 50-100'."""
    start: Annotated[Literal["known", "random"] | None, _default("start")] = None
    """First tick of HybridTrackQuickest-v0: at a switch to a known mode, or at a random moment in an unknown
    mode."""
    change_cost: Annotated[float | None, _default("change_cost")] = None
    """Cost of a change of the statement to a wrong mode in HybridTrackQuickest-v0, relative to the reward of
    a right tick."""
    hazard: Annotated[float | None, _default("hazard")] = None
    """Probability of a switch per tick that the bank of HybridTrackQuickest-v0 assumes."""

    @property
    def env_id(self) -> str:
        """The given id, or the default."""
        return DEFAULT_ENV if self.env is None else self.env

    def world_options(self, env_id: str | None = None) -> dict[str, Any]:
        """Return the given options, as keyword arguments of `gym.make`.

        Args:
            env_id: of the environment they are for; None is the given id, or the default.

        Raises:
            ArgumentError: the id is unknown, or its environment has no such option.
        """
        env_id = env_id or self.env_id
        names = [field.name for field in dataclasses.fields(WorldArguments) if field.name != "env"]
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        known = {field.name for field in dataclasses.fields(environment_options(env_id))}
        for name, value in given.items():
            if name not in known:
                environment = env_id.rpartition(":")[2]
                raise reject(name, value, f"no value, because {environment} has no such option")
        return given

    def world_of(self, decider: str) -> tuple[str, dict[str, Any]]:
        """Environment id and options for a decider.

        Args:
            decider: name of a decider. A run folder brings the id and the options of its training; flags that
                are given override these options.
        """
        card = read_card(decider)
        if card is None or self.env not in (None, card["environment"]):
            return self.env_id, self.world_options()
        trained = {name: value for name, value in card["options"].items() if name != "actions"}
        return card["environment"], trained | self.world_options(card["environment"])


def read_card(decider: str) -> dict[str, Any] | None:
    """Environment id and options on the card of a run folder; None for any other decider.

    Args:
        decider: name of a decider, with an optional ":threshold".

    Raises:
        ArgumentError: the card is damaged.
    """
    names = (decider, decider.rpartition(":")[0])
    for path in (Path(name) / CARD for name in names if name):
        if path.is_file():
            try:
                card = read_json(path)
                environment = _text_of(card["environment"])
                return {"environment": environment, "options": _options(card["options"], environment)}
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise reject("run", str(path.parent), f"a folder with a complete {CARD} ({error})") from None
    return None


def _text_of(value: Any) -> str:
    if not isinstance(value, str):
        raise reject("environment", value, "a registered id")
    return value


def _options(value: Any, environment: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise reject("options", value, "a mapping")
    known = {field.name for field in dataclasses.fields(environment_options(environment))}
    for name in value:
        if name not in known:
            raise reject("option", name, "an option of the environment")
    return value
