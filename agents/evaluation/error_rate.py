"""The flag that asks for an error rate instead of a threshold."""

from dataclasses import dataclass
from typing import Annotated

from agents.interface.help_texts import shown_default
from hybrid_env.checks import reject


@dataclass(kw_only=True)
class ErrorArguments:
    """Flag of the commands that run deciders at one threshold each."""

    error: Annotated[str | None, shown_default("the usual threshold")] = None
    """Rate to hold: '2%' of wrong decisions, or with unknown switches '2/1000', wrong changes in ticks. The
    threshold is chosen for it by simulation, as with the name 'shipped:2%'."""

    def at_error(self, name: str) -> str:
        """Return the name of a decider with the rate that is asked for."""
        if self.error is None:
            return name
        from agents.evaluation.chosen_threshold import RATES
        from agents.evaluation.registry import base_name  # loads slowly

        if not self.error.endswith(tuple(RATES.values())):
            raise reject("error", self.error, "a rate such as '2%', or '2/1000' with unknown switches")
        if base_name(name) != name:
            raise reject("decider", name, "a name without a threshold, with --error")
        return f"{name}:{self.error}"
