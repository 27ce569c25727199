"""Recipes of training: YAML in the manner of Stable-Baselines3's zoo, one file a recipe.

A file has an entry for an environment's id, or `default` for any; an entry names the algorithm (`algo`), the
steps (`n_timesteps`) and the hyper-parameters by the names that the algorithm gives them. `lin_6e-3` is a
learning rate that falls in a straight line. Unlike in the zoo, nothing is evaluated as Python.
"""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import yaml

from hybrid_env.checks import check_between, check_integer, check_number, check_positive, reject
from hybrid_env.options import WorldOptions

FOLDER = Path(__file__).parent / "recipes"
POLICIES = {"ppo": "MlpPolicy", "recurrent_ppo": "MlpLstmPolicy"}
EAGEREST = 0.3  # the largest doubt at which a track of the sequence agent may stop


@dataclass(frozen=True, kw_only=True)
class PPOSettings:
    """Hyper-parameters of PPO and of RecurrentPPO, as Stable-Baselines3 names them.

    gamma is 1, because segments are fast-forwarded and haste is priced by the delay cost already.

    Attributes:
        n_envs: tracks trained on at once.
        n_steps: steps of each track between updates.
        wait_bias: first bias of the logit of waiting; at 0 a fresh policy declares at once and never learns
            to wait.
        observe: names of the quantities that the policy sees, see `agents.features`; all if empty.
        beliefs: "shipped" or the run folder of a sequence agent: the policy sees what that believes, see
            `agents.stopping`, and decides when to stop; None sees the rows.
    """

    n_envs: int
    n_steps: int
    batch_size: int
    n_epochs: int
    learning_rate: str | float
    gae_lambda: float
    ent_coef: float
    policy: str
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    gamma: float = 1.0
    wait_bias: float = 5.0
    observe: tuple[str, ...] = ()
    beliefs: str | None = None

    def __post_init__(self) -> None:
        for name in ("n_envs", "n_steps", "n_epochs"):
            check_integer(name, getattr(self, name))
        check_integer("batch_size", self.batch_size, minimum=2)
        schedule(self.learning_rate)
        for name in ("gae_lambda", "gamma"):
            if isinstance(getattr(self, name), bool) or getattr(self, name) != 1.0:
                check_between(name, getattr(self, name), 0.0, 1.0)
        check_positive("ent_coef", self.ent_coef, allow_zero=True)
        check_number("wait_bias", self.wait_bias)
        if self.n_envs * self.n_steps % self.batch_size:
            samples = self.n_envs * self.n_steps
            raise reject("batch_size", self.batch_size, f"a divisor of n_envs x n_steps = {samples}")
        if self.beliefs is not None:
            if not isinstance(self.beliefs, str):
                raise reject("beliefs", self.beliefs, "'shipped' or the run folder of a sequence agent")
            if self.observe:
                raise reject("observe", self.observe, "nothing where the policy sees beliefs")
        if not isinstance(self.policy_kwargs, Mapping):
            raise reject("policy_kwargs", self.policy_kwargs, "a mapping")
        layers = self.policy_kwargs.get("net_arch", [1])
        if not isinstance(layers, list) or not layers:
            raise reject("net_arch", layers, "a list of one or more layers")
        for units in layers:
            check_integer("net_arch", units)


@dataclass(frozen=True, kw_only=True)
class TrainedWorld:
    """A world that the sequence agent is trained on, and its share of the tracks.

    Attributes:
        env: registered id; None is the id that the training is for.
        options: over those of the id and those that the training is for.
        n_envs: tracks.
    """

    n_envs: int
    env: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs)
        if self.env is not None and not isinstance(self.env, str):
            raise reject("env", self.env, "a registered id")
        known = [one.name for one in dataclasses.fields(WorldOptions)]
        if not isinstance(self.options, Mapping) or any(name not in known for name in self.options):
            raise reject("options", self.options, f"a mapping of {', '.join(known)}")


@dataclass(frozen=True, kw_only=True)
class SequenceSettings:
    """Hyper-parameters of the sequence agent.

    Attributes:
        worlds: what it is trained on at once.
        n_steps: ticks between updates.
        hidden: width of the memory of a hypothesis.
        strictest: smallest doubt at which a track may stop; the largest is 0.3, drawn in the logarithm.
        latest: tick at which every track stops: later ones teach little.
        stray: share of declarations that are replaced by any other. An anchor that a wrong decision spoiled
            is rare under a good policy, but takes three times as long where it was never practised.
    """

    worlds: tuple[TrainedWorld, ...]
    n_steps: int
    hidden: int
    learning_rate: str | float
    strictest: float
    latest: int
    stray: float

    def __post_init__(self) -> None:
        for name in ("n_steps", "hidden", "latest"):
            check_integer(name, getattr(self, name))
        if not self.worlds:
            raise reject("worlds", self.worlds, "one or more worlds")
        schedule(self.learning_rate)
        if not 0.0 < check_number("strictest", self.strictest) < EAGEREST:
            raise reject("strictest", self.strictest, f"a number between 0 and {EAGEREST}")
        if not 0.0 <= check_number("stray", self.stray) < 1.0:
            raise reject("stray", self.stray, "a number from 0 to below 1")


Settings = PPOSettings | SequenceSettings
ALGORITHMS: dict[str, type[PPOSettings] | type[SequenceSettings]] = {
    "ppo": PPOSettings,
    "recurrent_ppo": PPOSettings,
    "sequence": SequenceSettings,
}


@dataclass(frozen=True)
class Recipe:
    """How to train an agent.

    Attributes:
        name: of the recipe.
        algo: a key of `ALGORITHMS`.
        n_timesteps: environment steps, summed over tracks.
        settings: hyper-parameters.
    """

    name: str
    algo: str
    n_timesteps: int
    settings: Settings

    def as_json(self) -> dict[str, Any]:
        """What `recipe_of` reads."""
        entry = {"algo": self.algo, "n_timesteps": self.n_timesteps} | asdict(self.settings)
        return {"name": self.name, "entry": entry}


def schedule(rate: str | float) -> tuple[float, bool]:
    """A learning rate, and whether it falls to nothing."""
    text = str(rate)
    falls = text.startswith("lin_")
    try:
        value = float(text.removeprefix("lin_"))
    except ValueError:
        value = math.nan
    if isinstance(rate, bool) or not 0.0 < value <= 1.0:
        raise reject("learning_rate", rate, "a number above 0, at most 1, or lin_ and such a number")
    return value, falls


def recipe_names() -> list[str]:
    """Of the recipes that come with the package."""
    return sorted(path.stem for path in FOLDER.glob("*.yml"))


def load_recipe(name: str, env_id: str, changes: Sequence[str] = ()) -> Recipe:
    """Read a recipe.

    Args:
        name: of a recipe of the package, or the path of a YAML file.
        env_id: whose entry is taken, or else the entry `default`.
        changes: hyper-parameters to take instead, each "name=value" with a value in YAML.

    Raises:
        ArgumentError: no such recipe, an unreadable one, or a bad value in it.
    """
    path = FOLDER / f"{name}.yml" if name in recipe_names() else Path(name)
    allowed = ", ".join(recipe_names()) + ", or a YAML file"
    if not path.is_file():
        raise reject("recipe", name, allowed)
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise reject("recipe", name, f"{allowed} ({' '.join(str(error).split())})") from None
    short = env_id.rpartition(":")[2]
    entry = entries.get(short, entries.get("default")) if isinstance(entries, dict) else None
    if not isinstance(entry, dict):
        raise reject("recipe", name, f"a YAML file with an entry for {short} or default")
    entry = dict(entry)
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals:
            raise reject("set", change, "name=value")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError:
            raise reject("set", change, "name=value with a value in YAML") from None
        *outer, last = key.split(".")
        place = entry
        for part in outer:
            if not isinstance(place.get(part, {}), dict):
                raise reject("set", change, f"a value for {part} as a whole")
            place[part] = place = dict(place.get(part, {}))
        place[last] = value
    return recipe_of(path.stem, entry)


def recipe_of(name: str, entry: Mapping[str, Any]) -> Recipe:
    """The recipe of an entry.

    Raises:
        ArgumentError: a name that the algorithm does not have, one that it lacks, or a bad value.
    """
    entry = dict(entry)
    algo = entry.pop("algo", None)
    if not isinstance(algo, str) or algo not in ALGORITHMS:
        raise reject("algo", algo, ", ".join(ALGORITHMS))
    steps = check_integer("n_timesteps", entry.pop("n_timesteps", None))
    kind = ALGORITHMS[algo]
    known = {one.name: one for one in dataclasses.fields(kind)}
    for key in entry:
        if key not in known:
            raise reject("hyper-parameter", key, ", ".join(known))
    missing = [
        name
        for name, one in known.items()
        if one.default is dataclasses.MISSING
        and one.default_factory is dataclasses.MISSING
        and name not in entry
    ]
    if missing:
        raise reject("recipe", name, f"an entry with {', '.join(missing)}")
    if "worlds" in entry:
        entry["worlds"] = _worlds(entry["worlds"])
    if "observe" in entry:
        names = entry["observe"]
        if not isinstance(names, (list, tuple)) or not all(isinstance(one, str) for one in names):
            raise reject("observe", names, "a list of names")
        entry["observe"] = tuple(names)
    if "policy" in entry and entry["policy"] != POLICIES[algo]:
        raise reject("policy", entry["policy"], POLICIES[algo])
    if entry.get("beliefs") is not None and algo != "ppo":
        raise reject("beliefs", entry["beliefs"], "nothing for a policy that has a memory of its own")
    recipe = Recipe(name, algo, steps, kind(**entry))
    try:
        json.dumps(recipe.as_json(), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise reject("recipe", name, f"plain values ({error})") from None
    return recipe


def _worlds(value: Any) -> tuple[TrainedWorld, ...]:
    try:
        return tuple(TrainedWorld(**world) for world in value)
    except TypeError:
        raise reject("worlds", value, "a list of mappings with n_envs, and maybe env and options") from None
