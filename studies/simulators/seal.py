"""The seal of the closed paths: digests of code and weights, fixed before they were opened."""

import json
from hashlib import sha256
from importlib.metadata import distributions
from importlib.resources import files
from pathlib import Path

from hybrid_env import ArgumentError

# Of the first closed path.
CLOSED = 7_000_000_000
FOLDER = Path(__file__).parent
SEAL = FOLDER / "sealed.json"
CODE = ("aircraft", "airliners", "cars", "paths", "study", "worlds")
PROGRAMS = ("jsbsim", "bluesky-simulator", "openap", "eclipse-sumo")


def current_seal() -> dict[str, dict[str, str]]:
    """Return the SHA-256 of the code of the study and of the weights of `robust`, and versions of
    the simulators.
    """
    weights = files("agents") / "learned" / "weights" / "unknown" / "robust"
    contents = {
        "code": {name: (FOLDER / f"{name}.py").read_bytes() for name in CODE},
        "weights": {
            name: (weights / name).read_bytes() for name in ("policy.json", "policy.safetensors")
        },
    }
    digests = {
        part: {name: sha256(content).hexdigest() for name, content in named.items()}
        for part, named in contents.items()
    }
    versions = {
        name: next((program.version for program in distributions(name=name)), "missing")
        for name in PROGRAMS
    }
    return digests | {"programs": versions}


def first_closed_path() -> int:
    """Return the seed of the first closed path; refuse if anything differs from the seal."""
    kept = json.loads(SEAL.read_text(encoding="utf-8"))
    now = current_seal()
    differ = [
        name
        for part, named in now.items()
        for name, value in named.items()
        if kept[part].get(name) != value
    ]
    if differ:
        raise ArgumentError(f"{', '.join(differ)} differ from {SEAL.name}: the paths stay closed")
    return CLOSED
