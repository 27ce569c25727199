"""Flags of a comparison on recorded flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from agents.evaluation.flights import FlightTask


@dataclass(kw_only=True)
class FlightArguments:
    """Flags of recorded flights."""

    flights: tuple[str, ...] | None = None
    """Compare on recorded flights of the package 'traffic': without a value on those of the tiers, else on
    these ids file:icao24:k."""
    source: Path | None = None
    """With --flights: folder or wheel of the package 'traffic'; by default where it is installed."""
    tier: tuple[str, ...] = ("A", "B", "C", "D", "stress")
    """With --flights: tiers of quality, and flights with special manoeuvres, which no total contains."""
    form: Literal["native", "semi-real"] = "native"
    """With --flights: as reported, or the smoothed flight with white noise in the setting of
    HybridTrackQuickest-v0, whose deciders are then compared, 'shipped' among them."""

    def flight_task(self) -> "FlightTask":
        """Return the task."""
        from agents.evaluation.flights import FlightTask

        return FlightTask(self.source, self.flights or (), self.tier, self.form)
