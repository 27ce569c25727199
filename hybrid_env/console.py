"""The console script `hybridtrack`, which also runs where another distribution has packages of our names."""

import importlib
import sys
from importlib import metadata

PACKAGES = ("agents", "baselines")
DISTRIBUTION = "hybrid-track"


def main() -> int:
    """Run `agents.cli.main`, or say which distribution stands in its place. Returns the exit status."""
    try:
        command = importlib.import_module("agents.cli").main
    except Exception as error:
        found = metadata.packages_distributions()
        others = {name: set(found.get(name, ())) - {DISTRIBUTION} for name in PACKAGES}
        shown = [f"'{name}' of {', '.join(sorted(kinds))}" for name, kinds in others.items() if kinds]
        if not shown:
            raise
        reason = " ".join(str(error).split())[:100]
        print(
            f"hybridtrack: the package {' and '.join(shown)} stands in the place of that of {DISTRIBUTION} "
            f"({reason}): install {DISTRIBUTION} in a virtual environment of its own",
            file=sys.stderr,
        )
        return 2
    status: int = command()
    return status


if __name__ == "__main__":
    sys.exit(main())
