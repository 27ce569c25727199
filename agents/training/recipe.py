"""Training recipes: hyper-parameters as YAML in the format of RL Baselines3 Zoo, one file per recipe.

A file has one entry per environment id, or `default` for any id. An entry names the algorithm (`algo`), the
number of steps (`n_timesteps`) and the hyper-parameters by their names in the algorithm. `lin_6e-3` is a
learning rate that decays linearly. Unlike in the zoo, no value is evaluated as Python.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from agents.interface.input_files import parse_yaml, read_text
from agents.learned.network_settings import LARGEST_HIDDEN, check_policy_kwargs
from agents.training.learning_rate import learning_rate_schedule
from agents.training.statement_settings import StatementSettings
from hybrid_env.checks import check_between, check_integer, check_number, check_positive, reject
from hybrid_env.limits import MAX_RADII
from hybrid_env.options import WorldOptions

FOLDER = Path(__file__).parent / "recipes"
POLICIES = {"ppo": "MlpPolicy", "recurrent_ppo": "MlpLstmPolicy"}
LARGEST_ROLLOUT = 2**21  # samples of an update of PPO, which then take less than a gigabyte
LARGEST_UNROLLING = 2**22  # ticks x hypotheses of an update of the anchor agent
MOST_WORLDS = 100
MOST_DRAWN = 1000
LARGEST_COUNT = 100_000  # tracks, steps or passes
LARGEST_WEIGHT = 100.0  # of the entropy in the loss, and of the initial bias
LARGEST_ALPHA = 0.3  # largest error probability at which a training track of the anchor agent declares


@dataclass(frozen=True, kw_only=True)
class PPOSettings:
    """Hyper-parameters of PPO and RecurrentPPO, named as in Stable-Baselines3.

    The default gamma is 1: segments are fast-forwarded after a declaration, and delay is already penalised by
    the delay cost.

    Attributes:
        n_envs: number of parallel tracks.
        n_steps: steps of each track per rollout.
        batch_size: mini-batch size; a divisor of n_envs x n_steps.
        n_epochs: passes over a rollout per update.
        learning_rate: constant, or "lin_" and the initial value for linear decay to zero.
        gae_lambda: of generalized advantage estimation.
        ent_coef: entropy coefficient of the loss.
        policy: class of the policy, as in `POLICIES`.
        policy_kwargs: keyword arguments of the policy.
        gamma: discount factor.
        wait_bias: initial logit bias of the waiting action. With 0 an untrained policy declares immediately
            and does not learn to wait.
        observe: names of the observed quantities, see `agents.learned.features`; all if empty.
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

    def __post_init__(self) -> None:
        for name in ("n_envs", "n_steps", "n_epochs"):
            check_integer(name, getattr(self, name), maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, minimum=2)
        learning_rate_schedule(self.learning_rate)
        for name in ("gae_lambda", "gamma"):
            if isinstance(getattr(self, name), bool) or getattr(self, name) != 1.0:
                check_between(name, getattr(self, name), 0.0, 1.0)
        check_positive("ent_coef", self.ent_coef, allow_zero=True)
        for name in ("ent_coef", "wait_bias"):
            if abs(check_number(name, getattr(self, name))) > LARGEST_WEIGHT:
                raise reject(name, getattr(self, name), f"a magnitude of at most {LARGEST_WEIGHT:g}")
        samples = self.n_envs * self.n_steps
        if samples > LARGEST_ROLLOUT:
            raise reject("n_steps", self.n_steps, f"n_envs x n_steps of at most {LARGEST_ROLLOUT:,}")
        if samples % self.batch_size:
            raise reject("batch_size", self.batch_size, f"a divisor of n_envs x n_steps = {samples}")
        check_policy_kwargs(self.policy_kwargs, self.policy == POLICIES["recurrent_ppo"])


@dataclass(frozen=True, kw_only=True)
class TrainingWorld:
    """One environment that the anchor agent is trained in, and its number of tracks.

    Attributes:
        n_envs: number of parallel tracks.
        env: registered id; None uses the id of the run.
        options: environment options that override those of the id and of the run.
    """

    n_envs: int
    env: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)
        if self.env is not None and not isinstance(self.env, str):
            raise reject("env", self.env, "a registered id")
        if not isinstance(self.options, Mapping):
            raise reject("options", self.options, "a mapping")
        for name in self.options:
            if name not in {one.name for one in dataclasses.fields(WorldOptions)}:
                raise reject("option", name, "an option of the environment")


@dataclass(frozen=True, kw_only=True)
class DrawnWorlds:
    """Random environments that the anchor agent is trained in, see `agents.evaluation.drawn_worlds`.

    Attributes:
        radii: number of radii of each bank.
        worlds: number of environments at the same time.
        n_envs: number of parallel tracks in each.
    """

    radii: int
    worlds: int
    n_envs: int

    def __post_init__(self) -> None:
        check_integer("radii", self.radii, maximum=MAX_RADII)
        check_integer("worlds", self.worlds, maximum=MOST_DRAWN)
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)


@dataclass(frozen=True, kw_only=True)
class AnchorSettings:
    """Hyper-parameters of the anchor agent.

    Attributes:
        worlds: environments that it is trained in at the same time.
        n_steps: ticks between updates.
        hidden: units of each hidden layer.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
        smallest_alpha: smallest error probability at which a track declares. The threshold of a track is
            drawn log-uniformly between this value and 0.3 after each declaration.
        last_tick: tick at which every track declares; later ticks contribute little to learning.
        random_declarations: probability that a declaration is replaced by a random hypothesis. Anchors after
            a wrong decision are rare under a good policy; without such training, decisions from them take
            three times as long.
        drawn_worlds: random environments besides `worlds`.
        updates_per_world: updates after which the random environments are drawn anew.
        buffer_size: number of the last anchors, and of the last declarations, that samples are drawn from.
        batches: steps of the optimizer per update.
        batch_size: samples of a step.
    """

    worlds: tuple[TrainingWorld, ...]
    n_steps: int
    hidden: int
    learning_rate: str | float
    smallest_alpha: float
    last_tick: int
    random_declarations: float
    drawn_worlds: tuple[DrawnWorlds, ...] = ()
    updates_per_world: int = 32
    buffer_size: int = 50_000
    batches: int = 8
    batch_size: int = 1024

    def __post_init__(self) -> None:
        limits = {
            "n_steps": 10_000, "hidden": LARGEST_HIDDEN, "last_tick": 10**6, "updates_per_world": 10**6,
            "buffer_size": 10**6, "batches": 1000, "batch_size": 10**5,
        }  # fmt: skip
        for name, largest in limits.items():
            check_integer(name, getattr(self, name), maximum=largest)
        if not 1 <= len(self.worlds) <= MOST_WORLDS:
            raise reject("worlds", self.worlds, f"one to {MOST_WORLDS} environments")
        if len(self.drawn_worlds) > MOST_WORLDS:
            raise reject("drawn_worlds", self.drawn_worlds, f"at most {MOST_WORLDS} entries")
        tracks = 3 * sum(world.n_envs for world in self.worlds)
        tracks += sum(drawn.worlds * drawn.n_envs * (2 * drawn.radii + 1) for drawn in self.drawn_worlds)
        if self.n_steps * tracks > LARGEST_UNROLLING:
            allowed = f"n_steps x hypotheses of all tracks of at most {LARGEST_UNROLLING:,}"
            raise reject("n_steps", self.n_steps, allowed)
        learning_rate_schedule(self.learning_rate)
        if not 0.0 < check_number("smallest_alpha", self.smallest_alpha) < LARGEST_ALPHA:
            raise reject("smallest_alpha", self.smallest_alpha, f"a number between 0 and {LARGEST_ALPHA}")
        if not 0.0 <= check_number("random_declarations", self.random_declarations) < 1.0:
            raise reject("random_declarations", self.random_declarations, "a number >= 0 and < 1")


Settings = PPOSettings | AnchorSettings | StatementSettings
ALGORITHMS: dict[str, type[PPOSettings] | type[AnchorSettings] | type[StatementSettings]] = {
    "ppo": PPOSettings,
    "recurrent_ppo": PPOSettings,
    "anchor": AnchorSettings,
    "statements": StatementSettings,
}


@dataclass(frozen=True)
class Recipe:
    """Algorithm and hyper-parameters of a training run.

    Attributes:
        name: of the recipe.
        algo: a key of `ALGORITHMS`.
        n_timesteps: environment steps, summed over tracks.
        settings: hyper-parameters of the algorithm.
    """

    name: str
    algo: str
    n_timesteps: int
    settings: Settings

    def as_json(self) -> dict[str, Any]:
        """Return plain values; `recipe_of` reads the entry."""
        entry = {"algo": self.algo, "n_timesteps": self.n_timesteps} | asdict(self.settings)
        return {"name": self.name, "entry": entry}


def recipe_names() -> list[str]:
    """Return the names of the recipes that come with the package."""
    return sorted(path.stem for path in FOLDER.glob("*.yml"))


def load_recipe(name: str, env_id: str, changes: Sequence[str] = ()) -> Recipe:
    """Read a recipe.

    Args:
        name: of a recipe of the package, or the path of a YAML file.
        env_id: id whose entry is used; the entry `default` if there is none.
        changes: hyper-parameters to override, each "name=value" with a value in YAML.

    Raises:
        ArgumentError: the recipe does not exist, is unreadable, or has an invalid value.
    """
    path = FOLDER / f"{name}.yml" if name in recipe_names() else Path(name)
    allowed = ", ".join(recipe_names()) + ", or a YAML file"
    try:
        entries = parse_yaml(read_text(path))
    except (OSError, ValueError) as error:
        raise reject("recipe", name, f"{allowed} ({error})") from None
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
            value = parse_yaml(text)
        except ValueError:
            raise reject("set", change, "name=value with a value in YAML") from None
        *outer, last = key.split(".")
        place = entry
        for part in outer:
            if not isinstance(place.get(part, {}), dict):
                raise reject("set", change, f"a single value for {part}")
            place[part] = place = dict(place.get(part, {}))
        place[last] = value
    return recipe_of(path.stem, entry)


def recipe_of(name: str, entry: Mapping[str, Any]) -> Recipe:
    """Create a recipe from an entry.

    Args:
        name: of the recipe.
        entry: algorithm, number of steps and hyper-parameters.

    Raises:
        ArgumentError: an unknown hyper-parameter, a missing one, or an invalid value.
    """
    if not isinstance(name, str) or not isinstance(entry, Mapping):
        raise reject("recipe", name, "a name, and an entry with hyper-parameters")
    entry = dict(entry)
    algo = entry.pop("algo", None)
    if not isinstance(algo, str) or algo not in ALGORITHMS:
        raise reject("algo", algo, ", ".join(ALGORITHMS))
    steps = check_integer("n_timesteps", entry.pop("n_timesteps", None), maximum=10**12)
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
        entry["worlds"] = _worlds("worlds", TrainingWorld, entry["worlds"])
    if "drawn_worlds" in entry:
        entry["drawn_worlds"] = _worlds("drawn_worlds", DrawnWorlds, entry["drawn_worlds"])
    if "observe" in entry:
        names = entry["observe"]
        if not isinstance(names, (list, tuple)) or not all(isinstance(one, str) for one in names):
            raise reject("observe", names, "a list of names")
        entry["observe"] = tuple(names)
    if "policy" in entry and entry["policy"] != POLICIES[algo]:
        raise reject("policy", entry["policy"], POLICIES[algo])
    recipe = Recipe(name, algo, steps, kind(**entry))
    try:
        json.dumps(recipe.as_json(), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise reject("recipe", name, f"plain values ({error})") from None
    return recipe


def _worlds(name: str, kind: type[TrainingWorld | DrawnWorlds], value: Any) -> tuple[Any, ...]:
    try:
        return tuple(kind(**world) for world in value)
    except TypeError:
        names = ", ".join(one.name for one in dataclasses.fields(kind))
        raise reject(name, value, f"a list of mappings with some of {names}") from None
