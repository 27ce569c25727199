"""The flags of commands whose calls can run in parallel."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from agents.interface.parallel import Workers


@dataclass(kw_only=True)
class ParallelArguments:
    """Flags for parallel work. The results do not depend on them."""

    jobs: int = 1
    """Number of processes, or of tasks at a time with --engine ray; one for each core is a good choice."""
    engine: Literal["local", "ray"] = "local"
    """'local' for processes of this machine; 'ray' for the Ray cluster at RAY_ADDRESS, which 'ray start'
    starts, or one on this machine."""

    def workers(self) -> "Workers":
        """Return where calls run.

        Raises:
            ArgumentError: a flag is out of range, or Ray is not installed.
        """
        from agents.interface.parallel import Workers

        return Workers(self.jobs, self.engine)
