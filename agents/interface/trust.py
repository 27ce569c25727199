"""The flag that lets files of others be unpickled."""

from dataclasses import dataclass

TRUST = "HYBRIDTRACK_TRUST"  # environment variable: 1 lets policies of others be unpickled, which runs the code in them


@dataclass(kw_only=True)
class TrustArguments:
    """Flag of the commands that read policies of other libraries."""

    trust: bool = False
    """Unpickle model.zip, which runs the code in it; needed for networks of other than the usual layers."""
