"""The kernel: object, measurement, bank, reward, fast-forward and autoreset of many tracks in one
loop, for announced and for unknown switches. The operations of every tick are loops over the lanes
of a block (see `memory`). Decisions, statements and new segments are computed for single lanes.
Threads step different blocks.
"""

from typing import Any

import numpy as np

from hybrid_env.core.banks import operations
from hybrid_env.core.compilation import inlined
from hybrid_env.core.memory import LANES, arrays_of

# Events of a lane, combined as bits: of a step the first two. A halted lane has no tick.
DECIDED, TERMINATED, BEGUN, HALTED = 1, 2, 4, 8


@inlined
def advance(reset: bool, process: Any, bank_class: type, setting: Any) -> int:
    """Check all actions, then step the blocks of this call; see `kernels.entry_point`.

    process: `announced` or `unknown`. Its `prepare_lane` applies the action of a lane or begins its
    next episode, and its `wait_lane` prepares each further tick up to the next decision; both
    return the events of the lane. Its `tick` advances object and bank of some lanes, and its
    `write_rows` writes their rows.
    """
    arrays = arrays_of(setting)
    for i in range(0 if reset else setting.tracks):
        if arrays.actions[i] < 0 or arrays.actions[i] >= setting.action_count:
            return -1 - i
    scratch = arrays.scratch[0]
    events = 0
    for b in range(setting.first_block, setting.last_block):
        block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
        lanes = min(LANES, setting.tracks - b * LANES)
        # One bit per lane: a segment begins; a tick passes, so that there is a new row.
        begun = 0
        moved = 0
        for ticks in range(setting.decide_every):
            # All lanes advance in this tick.
            all_running = True
            for lane in range(lanes):
                i = b * LANES + lane
                event = HALTED
                if ticks > 0:
                    if scratch.running[lane] > 0:
                        event = process.wait_lane(block, np.uint64(lane), i, bank, setting)
                elif not reset or arrays.actions[i] != 0:
                    event = process.prepare_lane(reset, block, np.uint64(lane), i, bank, setting)
                events |= event
                runs = event & (TERMINATED | HALTED) == 0
                scratch.running[lane] = 1 if runs else 0
                all_running = all_running and runs
                begun |= (1 if event & BEGUN else 0) << lane
                moved |= scratch.running[lane] << lane
            for first in range(1 if all_running else lanes):
                if scratch.running[first] > 0:
                    # Unsigned indices need no check for negative values, so that loops over lanes
                    # compile to SIMD code.
                    start = np.uint64(first)
                    stop = np.uint64(lanes if all_running else first + 1)
                    process.tick(b, bank_class, start, stop, setting)
        all_moved = moved == (1 << lanes) - 1
        for first in range(1 if all_moved else lanes):
            if moved & (1 << first):
                start = np.uint64(first)
                stop = np.uint64(lanes if all_moved else first + 1)
                process.write_rows(b, bank_class, start, stop, begun, setting)
    return -1 - setting.tracks if setting.noise_failed else events & (DECIDED | TERMINATED)
