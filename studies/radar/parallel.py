"""Independent calls in several processes."""

from collections.abc import Callable, Mapping
from typing import Any

import joblib

Calls = Mapping[Any, Callable[[], Any]]
# Called with the stage, the work done and the total.
Progress = Callable[[str, int, int], None]


def silent(
    stage: str,
    done: int,
    total: int,
) -> None:
    """Show no progress."""


def run_calls(
    calls: Calls,
    jobs: int,
    progress: Progress,
    stage: str,
    before: int = 0,
    total: int = 0,
) -> dict[Any, Any]:
    """Return the results of the calls of a stage by name; of its `total` work `before` is done."""
    with joblib.parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        ended = joblib.Parallel(return_as="generator")(
            joblib.delayed(call)() for call in calls.values()
        )
        found = {}
        for name, result in zip(calls, ended, strict=True):
            found[name] = result
            progress(stage, before + len(found), total or len(calls))
    return found
