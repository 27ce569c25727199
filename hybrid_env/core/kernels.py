"""The compiled entry points of the kernel, one for each bank and each value of the option `follow`."""

from typing import Any

from hybrid_env.core.anchor_aware_bank import aware_arrays, aware_banks
from hybrid_env.core.compilation import compiled
from hybrid_env.core.kernel import advance
from hybrid_env.core.memory import array_at
from hybrid_env.core.published_bank import published_arrays, published_banks
from hybrid_env.core.records import PARAMETERS
from hybrid_env.core.student_bank import student_banks


@compiled
def advance_published(address: int, reset: bool) -> int:
    """Step every track, or with `reset` begin a new episode on every track whose action is not 0.

    In a step, a terminated track begins its next episode. The observation of a track that terminates is not
    changed: it is the one on which the last decision was made.

    Args:
        address: address of a record `records.PARAMETERS`, whose arrays must exist during the call. Only its
            blocks first_block .. last_block - 1 are stepped, so that threads can share the tracks.
        reset: True begins new episodes, False steps.

    Returns:
        `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated. If the action of track i
        is outside the space, -1 - i; then no track is stepped.
    """
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, published_banks(setting), setting, None)


@compiled
def advance_aware(address: int, reset: bool) -> int:
    """Like `advance_published`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, aware_banks(setting), setting, None)


@compiled
def advance_published_merged(address: int, reset: bool) -> int:
    """Like `advance_published`; all filters run on after a decision."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, published_banks(setting), setting, True)


@compiled
def advance_aware_merged(address: int, reset: bool) -> int:
    """Like `advance_aware`; all filters run on after a decision."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, aware_banks(setting), setting, True)


@compiled
def advance_student(address: int, reset: bool) -> int:
    """Like `advance_published`, with the robust likelihood."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, student_banks(setting), setting, None)


@compiled
def advance_student_merged(address: int, reset: bool) -> int:
    """Like `advance_published_merged`, with the robust likelihood."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance(reset, student_banks(setting), setting, True)


BANKS: dict[str, Any] = {
    "published": published_arrays,
    "oracle": published_arrays,
    "anchor_aware": aware_arrays,
}
"""Allocation function of each bank, by the value of the option `bank`."""

KERNELS: dict[tuple[str, str, bool], Any] = {
    ("published", "declared", False): advance_published,
    ("oracle", "declared", False): advance_published,
    ("anchor_aware", "declared", False): advance_aware,
    ("published", "bank", False): advance_published_merged,
    ("oracle", "bank", False): advance_published_merged,
    ("anchor_aware", "bank", False): advance_aware_merged,
    ("published", "declared", True): advance_student,
    ("oracle", "declared", True): advance_student,
    ("published", "bank", True): advance_student_merged,
    ("oracle", "bank", True): advance_student_merged,
}
"""Kernel by the values of the options `bank` and `follow`, and whether the likelihood is robust."""
