"""The console script `hybridtrack`, which also runs where another distribution has packages of
our names.
"""

import importlib
import sys
from importlib import metadata

from hybrid_env.extras import DISTRIBUTION, MissingExtraError, explained


def main() -> int:
    """Run `agents.cli.main`, or say which extra it needs or which distribution stands in its
    place.
    """
    # The commands load slowly.
    if sys.argv[1:] == ["--version"]:
        print(f"hybridtrack {metadata.version(DISTRIBUTION)}")
        return 0
    try:
        with explained():
            try:
                command = importlib.import_module("agents.cli").main
            except Exception:
                foreign = _foreign()
                if foreign is None:
                    raise
                print(f"hybridtrack: {foreign}", file=sys.stderr)
                return 2
            return command()
    except MissingExtraError as error:
        if {"-h", "--help"} & {*sys.argv[1:]}:
            print(_help(error))
            return 0
        print(f"hybridtrack: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        # While the commands load.
        print("hybridtrack: interrupted", file=sys.stderr)
        return 130


def _help(error: MissingExtraError) -> str:
    """Return the help without the flags, which the extra describes."""
    commands = importlib.import_module("agents.commands")
    texts = commands.EXAMPLES
    examples = texts.get(sys.argv[1], texts[""]).replace("\n", "\n  ")
    return f"commands: {', '.join(commands.COMMANDS)}\nexamples:{examples}\n{error}"


def _foreign() -> str | None:
    """Return which packages of another distribution stand in the place of ours; None if none do."""
    distributions = metadata.packages_distributions()
    packages = ("agents", "baselines")
    others = {name: set(distributions.get(name, ())) - {DISTRIBUTION} for name in packages}
    shown = [f"'{name}' of {', '.join(sorted(kinds))}" for name, kinds in others.items() if kinds]
    if not shown:
        return None
    return (
        f"the package {' and '.join(shown)} stands in the place of that of {DISTRIBUTION}:"
        f" install {DISTRIBUTION} in a virtual environment of its own"
    )


if __name__ == "__main__":
    sys.exit(main())
