"""Independent calls in several processes."""

from collections.abc import Callable, Mapping
from typing import Any

import joblib

Calls = Mapping[Any, Callable[[], Any]]
# Called with the stage, the work done and the total.
Progress = Callable[[str, int, int], None]


def silent(stage: str, done: int, total: int) -> None:
    """Show no progress."""


def run_calls(calls: Calls, jobs: int, on_done: Callable[[int], None]) -> dict[Any, Any]:
    """Return the results of calls by name; `on_done` gets the number of those that have ended."""
    with joblib.parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        ended = joblib.Parallel(return_as="generator")(
            joblib.delayed(call)() for call in calls.values()
        )
        found = {}
        for name, result in zip(calls, ended, strict=True):
            found[name] = result
            on_done(len(found))
    return found
