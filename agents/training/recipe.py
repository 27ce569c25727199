"""Training recipes: hyper-parameters as YAML in the format of RL Baselines3 Zoo, one file per
recipe.

A file has one entry per environment id, or `default` for any id, before which `modes` is for modes
of the user. An entry names the algorithm (`algo`), the number of steps (`n_timesteps`) and the
hyper-parameters by their names in the algorithm; or it is the id whose entry is used. `lin_6e-3` is
a learning rate that decays linearly. Unlike in the zoo, no value is evaluated as Python.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from agents.interface.input_files import parse_yaml
from agents.learned.algorithm_names import find_algorithm
from hybrid_env.checks import check_integer, declared_fields, reject, unknown
from hybrid_env.json_files import read_text


@dataclass(frozen=True)
class Recipe:
    """Algorithm and hyper-parameters of a training run."""

    name: str
    # Name of an algorithm, see `find_algorithm`.
    algo: str
    # Environment steps, summed over tracks.
    n_timesteps: int
    # A dataclass, `Settings` of the algorithm.
    settings: Any

    @property
    def title(self) -> str:
        """Name of its agents in tables: that of the algorithm, if the recipe has its name, so that
        "PPO, recipe" stands beside a model of the library with other settings.
        """
        if self.name != self.algo:
            return self.name
        return f"{find_algorithm(self.algo).__name__}, recipe"

    def as_json(self) -> dict[str, Any]:
        """Return plain values; `recipe_of` reads the entry."""
        entry = {"algo": self.algo, "n_timesteps": self.n_timesteps} | asdict(self.settings)
        return {"name": self.name, "entry": entry}


def package_recipes() -> dict[str, Path]:
    """Return the files of the recipes that come with the package, by name."""
    folder = Path(__file__).parent / "recipes"
    return {path.stem: path for path in sorted(folder.glob("*.yml"))}


def load_recipe(
    name: str, env_id: str, changes: Sequence[str] = (), own_modes: bool = False
) -> Recipe:
    """Read a recipe.

    Args:
        name: of a recipe of the package, or the path of a YAML file.
        env_id: id whose entry is used; the entry `modes` or `default` if there is none.
        changes: hyper-parameters to override, each "name=value" with a value in YAML.
        own_modes: whether the environment has modes of the user.
    """
    known = package_recipes()
    path = known.get(name) or Path(name)
    if path.suffix not in (".yml", ".yaml") and not path.is_file():
        raise unknown("recipe", name, known)
    try:
        entries = parse_yaml(read_text(path))
    except (OSError, ValueError) as error:
        raise reject("recipe", name, f"a YAML file ({error})") from None
    short = env_id.rpartition(":")[2]
    entry = None
    if isinstance(entries, dict):
        names = [short, *["modes"] * own_modes, "default"]
        entry = next((entries[name] for name in names if name in entries), None)
        entry = entries.get(entry) if isinstance(entry, str) else entry
    if not isinstance(entry, dict):
        raise reject("recipe", name, f"a YAML file with an entry for {short} or default")
    entry = dict(entry)
    for change in changes:
        key, equals, text = change.partition("=")
        *outer, last = key.split(".")
        place = entry
        try:
            value = parse_yaml(text)
            for part in outer:
                place[part] = place = dict(place.get(part, {}))
        except (TypeError, ValueError):
            equals = ""
        if not equals:
            raise reject("set", change, "name=value with a value in YAML")
        place[last] = value
    if "algo" in entry:
        # A recipe is of the user, and so is the code that it names.
        find_algorithm(entry["algo"], imported=True)
    return recipe_of(path.stem, entry)


def recipe_of(name: str, entry: Mapping[str, Any]) -> Recipe:
    """Create a recipe from its entry: algorithm, number of steps and hyper-parameters."""
    if not isinstance(name, str) or not isinstance(entry, Mapping):
        raise reject("recipe", name, "a name, and an entry with hyper-parameters")
    entry = dict(entry)
    algo = entry.pop("algo", None)
    kind = find_algorithm(algo)
    steps = check_integer("n_timesteps", entry.pop("n_timesteps", None), maximum=10**12)
    known = declared_fields(kind.Settings)
    for key in entry.keys() - known.keys():
        raise unknown("set", key, known)
    try:
        settings = kind.settings_of(entry)
    except TypeError as error:
        raise reject("recipe", name, f"an entry with all hyper-parameters ({error})") from None
    recipe = Recipe(name, algo, steps, settings)
    try:
        json.dumps(recipe.as_json(), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise reject("recipe", name, f"plain values ({error})") from None
    return recipe
