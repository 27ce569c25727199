"""The groups of measurements that `hybridtrack bench` takes."""

from collections.abc import Callable, Iterator

from agents.benchmark.environments import (
    banks,
    single_environment,
    threads,
    unknown_switches,
    vector_environment,
)
from agents.benchmark.filters import bank_step, study_2018
from agents.benchmark.online import online_tracker
from agents.benchmark.scaling import growth, start_up
from agents.benchmark.timing import Measurement
from agents.benchmark.training import training

GROUPS: dict[str, Callable[[], Iterator[Measurement]]] = {
    "single": single_environment,
    "vector": vector_environment,
    "quickest": unknown_switches,
    "threads": threads,
    "banks": banks,
    "bank": bank_step,
    "online": online_tracker,
    "study": study_2018,
    "training": training,
    "growth": growth,
    "startup": start_up,
}
