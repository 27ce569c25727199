"""What compiled functions outside this package are made of: decorators, memory, filter banks and
their formulas. The only way to the compiled core from outside `hybrid_env`.
"""

from typing import Any

from hybrid_env.core.banks import operations as operations
from hybrid_env.core.banks.anchor_aware import begin_motion as begin_motion
from hybrid_env.core.banks.anchor_aware import begin_turn as begin_turn
from hybrid_env.core.banks.anchor_aware import step_motion as step_motion
from hybrid_env.core.banks.bank import FilterModel as FilterModel
from hybrid_env.core.banks.bank import bank_arrays as bank_arrays
from hybrid_env.core.banks.bank import covariance_of as covariance_of
from hybrid_env.core.banks.bank import estimate_of as estimate_of
from hybrid_env.core.banks.bank import likeliest as likeliest
from hybrid_env.core.banks.bank import set_state as set_state
from hybrid_env.core.banks.bank import signed_radius as signed_radius
from hybrid_env.core.banks.bank import state_of as state_of
from hybrid_env.core.banks.filter import move_turn as move_turn
from hybrid_env.core.banks.filter import turn_coefficients as turn_coefficients
from hybrid_env.core.banks.sensing import write_measured as write_measured
from hybrid_env.core.compilation import COMPILING as COMPILING
from hybrid_env.core.compilation import compiled as compiled
from hybrid_env.core.compilation import internal as internal
from hybrid_env.core.compilation import prepare as prepare
from hybrid_env.core.compilation import summing as summing
from hybrid_env.core.memory import AWARE_HYPOTHESIS as AWARE_HYPOTHESIS
from hybrid_env.core.memory import HEIGHT_FIELDS as HEIGHT_FIELDS
from hybrid_env.core.memory import INNOVATION as INNOVATION
from hybrid_env.core.memory import LANES as LANES
from hybrid_env.core.memory import MEASURED as MEASURED
from hybrid_env.core.memory import MEASURED_FIELDS as MEASURED_FIELDS
from hybrid_env.core.memory import MOST_RATES as MOST_RATES
from hybrid_env.core.memory import SENSOR as SENSOR
from hybrid_env.core.memory import DenseImmBank as DenseImmBank
from hybrid_env.core.memory import ImmBank as ImmBank
from hybrid_env.core.memory import State as State
from hybrid_env.core.memory import Triangle4 as Triangle4
from hybrid_env.core.memory import aligned_zeros as aligned_zeros
from hybrid_env.core.memory import lanes_of as lanes_of
from hybrid_env.core.memory import triangle_of as triangle_of
from hybrid_env.core.observation_row import LOG_FLOOR as LOG_FLOOR

_prepared: set[Any] = set()


def run_compiled(function: Any, *arguments: Any) -> Any:
    """Call a `compiled` function, prepared at its first call. Arguments of the same classes must
    have the same types, because to ask numba for these takes a millisecond.
    """
    called = function, *map(type, arguments)
    if called not in _prepared:
        prepare(function, *arguments)
        _prepared.add(called)
    return function(*arguments)
