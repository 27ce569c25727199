"""Learning rates as recipes write them."""

import math
from contextlib import suppress

from hybrid_env.checks import reject


def learning_rate_schedule(rate: str | float) -> tuple[float, bool]:
    """Return the initial learning rate and whether it decays linearly.

    Raises:
        ArgumentError: not a number in (0, 1], with or without "lin_".
    """
    decays = isinstance(rate, str) and rate.startswith("lin_")
    value = math.nan
    if isinstance(rate, (str, int, float)):
        with suppress(ValueError, OverflowError):
            value = float(rate.removeprefix("lin_") if isinstance(rate, str) else rate)
    if isinstance(rate, bool) or not 0.0 < value <= 1.0:
        raise reject("learning_rate", rate, "a number above 0, at most 1, or lin_ and such a number")
    return value, decays
