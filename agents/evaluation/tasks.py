"""The task of an environment."""

from collections.abc import Mapping
from typing import Any

from agents.evaluation.announced import AnnouncedTask
from agents.evaluation.task import Task
from agents.evaluation.unknown import UnknownTask
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from hybrid_env.registration import environment_options

# Three hypotheses and 21 of the published bank, and three with unknown switches.
THREE, BANK, QUICKEST = (
    f"hybrid_env:HybridTrack{part}-v0" for part in ("Published", "PublishedBank", "Quickest")
)
ENVIRONMENTS = {ANNOUNCED: THREE, UNKNOWN: QUICKEST}


def task_of(env_id: str, given: Mapping[str, Any] | None = None) -> Task:
    """Return the task of an environment."""
    options: Any = environment_options(env_id)
    kind = AnnouncedTask if options.switches == ANNOUNCED else UnknownTask
    return kind(env_id, dict(given or {}))
