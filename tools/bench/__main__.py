"""Measure the speed of environment, bank, tracker and training, against CartPole and
filterpy.
"""

import argparse
import datetime
import importlib.util
import json
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from tools.bench import environments, filters, growth, programs
from tools.bench.timing import Measurement, markdown, words

GROUPS: dict[str, Callable[[], Iterator[Measurement]]] = {
    "single": environments.single_environment,
    "vector": environments.vector_environment,
    "gymnasium": environments.gymnasium_benchmark,
    "quickest": environments.unknown_switches,
    "threads": environments.threads,
    "banks": environments.banks,
    "bank": filters.bank_step,
    "online": programs.online_tracker,
    "training": programs.training,
    "growth": growth.growth,
    "startup": growth.start_up,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure groups, print each figure as it comes, and write the table and the data.

    Args:
        arguments: of the command line; None takes those of the process.
    """
    parser = argparse.ArgumentParser(prog="python -m tools.bench", description=__doc__)
    parser.add_argument(
        "groups",
        nargs="*",
        metavar="group",
        help=f"all by default, in about three minutes: {', '.join(GROUPS)}",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results"), help="folder for bench.json and bench.md"
    )
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.groups) - set(GROUPS):
        parser.error(
            f"unknown group {', '.join(sorted(unknown))}: expected some of {', '.join(GROUPS)}"
        )
    chosen.out.mkdir(parents=True, exist_ok=True)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    title = f"{datetime.date.today():%Y-%m-%d}, {machine}"
    print(title)
    if importlib.util.find_spec("filterpy") is None:
        print("filterpy is not installed: skipping its comparisons (pip install filterpy)")
    found: list[Measurement] = []
    for group in chosen.groups or GROUPS:
        for one in GROUPS[group]():
            if not found or one.group != found[-1].group:
                print(f"\n{one.group}")
            print(f"  {one.name}: {'; '.join(word for word in words(one) if word)}", flush=True)
            found.append(one)
    data = {"title": title, "measurements": [asdict(one) for one in found]}
    (chosen.out / "bench.json").write_text(json.dumps(data, indent=2), encoding="utf-8")
    (chosen.out / "bench.md").write_text(markdown(found, title), encoding="utf-8")
    print(f"\nFiles in {chosen.out}: bench.json, bench.md")


if __name__ == "__main__":
    main()
