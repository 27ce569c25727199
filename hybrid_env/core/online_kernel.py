"""The kernels on a live sensor: bank, observation and declaration of one track, without an object.

The measurement comes from the caller instead of `true_object.move`. Everything else is computed by the
functions of `kernel` and `quickest_kernel`, so that the same measurements give the same observations as in
the environments. The track is the first lane of the first block.
"""

from typing import Any

import numpy as np

from hybrid_env.core import bank_operations
from hybrid_env.core.anchor_aware_bank import aware_banks
from hybrid_env.core.compilation import compiled, inlined
from hybrid_env.core.imm_bank import begin_imm, imm_of_block
from hybrid_env.core.kernel import (
    HAS_DECISION,
    begin_bank,
    chosen_mode,
    follow_lane,
    set_anchor,
    step_lanes,
)
from hybrid_env.core.kernel_arrays import arrays_of
from hybrid_env.core.memory import array_at
from hybrid_env.core.observation_row import (
    compare_hypotheses,
    write_expected_displacement,
    write_segment,
    write_tick,
)
from hybrid_env.core.published_bank import published_banks
from hybrid_env.core.quickest_kernel import arrays_of as quickest_arrays_of
from hybrid_env.core.quickest_kernel import record_statement
from hybrid_env.core.quickest_kernel import step_lanes as quickest_step_lanes
from hybrid_env.core.quickest_records import QUICKEST_PARAMETERS
from hybrid_env.core.quickest_row import write_quickest_row
from hybrid_env.core.records import PARAMETERS
from hybrid_env.core.student_bank import student_banks

FIRST, LAST = np.uint64(0), np.uint64(1)  # range of lanes; unsigned as in the other kernels


@inlined
def _begin(block: Any, bank: Any, arrays: Any, setting: Any, merged: Any) -> None:
    """End the segment, which decides it if it is undecided, and begin the next one at its estimate."""
    if block.segment[0] >= 0:
        if not arrays.flags[HAS_DECISION, 0]:
            block.active_mode[0] = chosen_mode(block, 0, bank, 0, setting)
        set_anchor(block, 0, bank, block.active_mode[0], merged)
    block.segment[0] += 1
    arrays.flags[HAS_DECISION, 0] = False
    for k in range(4):
        block.anchor[k, 0] = block.estimate[k, 0]
    begin_bank(block, 0, bank, arrays.radii, setting)


@inlined
def _measure(block: Any, bank: Any, arrays: Any, setting: Any, merged: Any) -> None:
    """Advance the bank by one tick; before the decision of the segment also write the observation."""
    decided = arrays.flags[HAS_DECISION, 0]
    block.tick[0] += 1
    block.length[0] = max(block.length[0], block.tick[0])
    if decided and merged is None:
        follow_lane(block, 0, bank, block.active_mode[0], setting)
    else:
        step_lanes(block, bank, FIRST, LAST, setting)
    if not decided:
        scratch, row = arrays.scratch[0], arrays.observations[0]
        compare_hypotheses(scratch, bank.hypotheses, FIRST, LAST)
        if block.tick[0] == 1:
            write_segment(row, block, 0, arrays.radii, setting)
        write_tick(row, block, 0, scratch, bank, setting)
        write_expected_displacement(row, block, 0, bank, setting)


@inlined
def _advance(begins: bool, banks: Any, setting: Any, merged: Any) -> int:
    """Step the track; see `online_published`. `merged` as in `kernel.advance`."""
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[0], bank_operations.bank_of_block(banks, 0)
    if begins:
        _begin(block, bank, arrays, setting, merged)
        return 0
    action = arrays.actions[0]
    if action > 0:
        block.active_mode[0] = chosen_mode(block, 0, bank, action, setting)
        arrays.flags[HAS_DECISION, 0] = True
    else:
        _measure(block, bank, arrays, setting, merged)
    set_anchor(block, 0, bank, block.active_mode[0], merged)
    return 0


@compiled
def online_published(address: int, begins: bool) -> int:
    """Begin a segment, process a measurement, or declare a mode, with the published bank.

    With `begins` the last segment ends, and the bank starts from its estimate; the first one starts from
    `estimate` and `kept_covariance` of the block, and its `segment` is -1. Otherwise action 0 advances the
    bank by the `measurement` of the block, which is NaN if there is none, and writes the observation until a
    mode is declared; action i + 1 declares mode i and advances nothing. Then `estimate` and
    `kept_covariance` of the block are those of the last decided mode.

    Args:
        address: address of a record `records.PARAMETERS`, whose arrays must exist during the call.
        begins: True begins a segment.

    Returns:
        0.
    """
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, published_banks(setting), setting, None)


@compiled
def online_aware(address: int, begins: bool) -> int:
    """Like `online_published`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, aware_banks(setting), setting, None)


@compiled
def online_published_merged(address: int, begins: bool) -> int:
    """Like `online_published`; all filters run on after a decision, and the estimate is merged."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, published_banks(setting), setting, True)


@compiled
def online_aware_merged(address: int, begins: bool) -> int:
    """Like `online_published_merged`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, aware_banks(setting), setting, True)


@compiled
def online_student(address: int, begins: bool) -> int:
    """Like `online_published`, with the robust likelihood."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, student_banks(setting), setting, None)


@compiled
def online_student_merged(address: int, begins: bool) -> int:
    """Like `online_published_merged`, with the robust likelihood."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(begins, student_banks(setting), setting, True)


ONLINE_KERNELS: dict[tuple[str, str, bool], Any] = {
    ("published", "declared", False): online_published,
    ("anchor_aware", "declared", False): online_aware,
    ("published", "bank", False): online_published_merged,
    ("anchor_aware", "bank", False): online_aware_merged,
    ("published", "declared", True): online_student,
    ("published", "bank", True): online_student_merged,
}
"""Kernel by the values of the options `bank` and `follow`, and whether the likelihood is robust."""


@inlined
def _advance_quickest(address: int, begins: bool, robust: Any) -> int:
    """Step the track; see `online_quickest`. `robust` as in `imm_bank.step_imm`."""
    setting = array_at(address, (1,), QUICKEST_PARAMETERS)[0]
    arrays, bank = quickest_arrays_of(setting), imm_of_block(setting, 0)
    block = arrays.blocks[0]
    if begins:
        block.time[0], block.stated_mode[0], block.stated_ticks[0] = 0, 0, 0
        begin_imm(bank, block, 0, arrays.actions[0])
        return 0
    if block.time[0] > 0:
        record_statement(block, 0, arrays.actions[0])
    quickest_step_lanes(bank, block, FIRST, LAST, arrays, setting, robust)
    block.time[0] += 1
    write_quickest_row(arrays.observations[0], block, 0, bank, setting)
    return 0


@compiled
def online_quickest(address: int, begins: bool) -> int:
    """Begin a track, or process a statement and a measurement, with unknown switch moments.

    With `begins` every filter starts from `estimate` and `covariance` of the block; the action is the mode
    before the first tick, -1 if it is not known. Otherwise the action is the statement of the last tick,
    which does not count before the first one; the bank advances by the `measurement` of the block, which is
    NaN if there is none, and the observation is written.

    Args:
        address: address of a record `QUICKEST_PARAMETERS`, whose arrays must exist during the call.
        begins: True begins a track.

    Returns:
        0.
    """
    return _advance_quickest(address, begins, None)


@compiled
def online_quickest_robust(address: int, begins: bool) -> int:
    """Like `online_quickest`, with the robust likelihood."""
    return _advance_quickest(address, begins, True)
