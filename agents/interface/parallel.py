"""Independent calls, in this process, in several processes, or on the machines of a Ray cluster.

Every call gets all that it needs, also its seeds, as arguments. So the results do not depend on the
number of processes, on their order or on their machines.
"""

import os
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, Any, Literal, TypeVar

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from agents.interface.help_texts import shown_default
from agents.interface.world_arguments import trusted, trusting
from hybrid_env.checks import ArgumentError, Count
from hybrid_env.compiled import COMPILING
from hybrid_env.extras import explained

Name = TypeVar("Name", bound=Hashable)
# Repeats of the calls of lost workers; more losses mean that a call itself ends its worker.
LARGEST_RETRIES = 3


@dataclass(kw_only=True)
class Workers:
    """Where calls run, as flags. The results do not depend on them."""

    jobs: Annotated[Count | None, shown_default("one for each core")] = None
    """Number of processes on this machine."""
    engine: Literal["local", "ray"] = "local"
    """'local' for processes of this machine; 'ray' for the Ray cluster at RAY_ADDRESS, which 'ray
    start' starts, or one on this machine.
    """

    @property
    def processes(self) -> int:
        """Number of processes; 1 is this one."""
        return joblib.cpu_count() if self.jobs is None else self.jobs

    def results(
        self,
        calls: Mapping[Name, Callable[[], Any]],
        on_done: Callable[[Name], None] = lambda name: None,
    ) -> Iterator[tuple[Name, Any]]:
        """Return the names and results of calls, in the order of the calls. A call has no arguments
        and can be pickled, such as `functools.partial(function, seed)`.

        The call of a worker that is lost (killed, out of memory, or on a machine that went down) is
        repeated. `on_done` is called with the name of every call that has ended.
        """
        if self.engine == "ray":
            ended = _ray(calls, self.processes)
        elif self.processes == 1 or len(calls) <= 1:
            ended = ((name, call()) for name, call in calls.items())
        else:
            ended = _processes(calls, min(self.processes, len(calls)))
        early: dict[Name, Any] = {}
        waiting = list(calls)[::-1]
        for name, result in ended:
            on_done(name)
            early[name] = result
            while waiting and waiting[-1] in early:
                yield waiting[-1], early.pop(waiting.pop())


def _processes(calls: Mapping[Name, Callable[[], Any]], jobs: int) -> Iterator[tuple[Name, Any]]:
    """Results with their names as they come, from processes of this machine."""
    # They would look for modules in the present folder first.
    os.environ["PYTHONSAFEPATH"] = "1"
    left = dict(calls)
    for _ in range(LARGEST_RETRIES + 1):
        with joblib.parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
            parallel = joblib.Parallel(
                return_as="generator_unordered", batch_size=1, pre_dispatch=jobs
            )
            waiting = [
                joblib.delayed(_in_worker)(*call, trusted(), quiet=number > 0)
                for number, call in enumerate(left.items())
            ]
            try:
                for name, result in parallel(waiting):
                    del left[name]
                    yield name, result
                return
            except TerminatedWorkerError:
                # The calls that are left are repeated with new workers.
                pass
    raise _lost()


def _in_worker(
    name: Name, call: Callable[[], Any], trust: bool, quiet: bool = True
) -> tuple[Name, Any]:
    """Run a call. A worker may be that of an earlier command: it trusts what this command trusts. A
    quiet one does not say that it compiles.
    """
    if quiet:
        os.environ[COMPILING] = "said"
    with trusting(trust):
        return name, call()


def _ray(calls: Mapping[Name, Callable[[], Any]], jobs: int) -> Iterator[tuple[Name, Any]]:
    """Results with their names as they come, from a Ray cluster, which repeats the calls of lost
    workers.

    The backend of `ray.util.joblib` is not used: one lost worker ends its pool with all results.
    """
    with explained():
        import ray
    if not ray.is_initialized():
        # One worker for each core.
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        # Without RAY_ADDRESS a cluster with one worker per job is started on this machine.
        local: dict[str, Any] = {} if os.environ.get("RAY_ADDRESS") else {"num_cpus": jobs}
        ray.init(
            log_to_driver=False, runtime_env={"env_vars": threads}, logging_level="error", **local
        )
    task = ray.remote(max_retries=LARGEST_RETRIES, num_cpus=1)(_in_worker)
    waiting = (task.remote(*call, trusted()) for call in calls.items())
    # Calls that a Ray cluster has at a time: enough for the workers of some machines.
    window = 1_000
    # A wait takes as long as there are calls that run.
    running = [*islice(waiting, window)]
    try:
        while running:
            (done,), running = ray.wait(running)
            running += islice(waiting, 1)
            yield ray.get(done)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except (ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError):
        raise _lost() from None
    finally:
        for reference in running:
            ray.cancel(reference, force=True)


def _lost() -> ArgumentError:
    return ArgumentError(
        f"workers were lost {LARGEST_RETRIES + 1} times: expected enough memory for every job, try"
        " fewer jobs"
    )
