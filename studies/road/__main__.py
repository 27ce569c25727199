"""Command line of the study: `python -m studies.road`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import joblib
import tyro

from agents import run_command
from studies.results import in_parallel, save_results
from studies.road import study


@dataclass(kw_only=True)
class Road:
    """Evaluate rules with selected process noise and threshold, and agents, in HybridTrackRoad-v0
    or HybridTrackQuickestRoad-v0.

    The default takes about half an hour on one core.
    """

    agents: Annotated[tuple[str, ...], tyro.conf.Positional] = ("robust", "shipped")
    """Agents: 'robust', 'shipped', run folders or models."""
    env: Literal["HybridTrackRoad-v0", "HybridTrackQuickestRoad-v0"] = "HybridTrackRoad-v0"
    """Environment."""
    rules: tuple[str, ...] | None = None
    """Rules, whose process noise and threshold are selected; by default those of the table."""
    banks: bool = False
    """Select the bank instead."""
    worlds: bool = False
    """Evaluate in environments around HybridTrackRoad-v0 instead."""
    episodes: int = 1500
    """Number of episodes of the report, six segments each."""
    selection: int = 200
    """Number of other episodes, on which everything is selected."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate two rules and no reference that is told, on 10 episodes."""
    out: Path = Path("results")
    """Folder for road.md, road.json and road.png, or for banks or worlds, both .md and .json."""

    def run(self) -> None:
        """Evaluate the deciders, print the table and write the files."""
        episodes, selection = (10, 10) if self.quick else (self.episodes, self.selection)
        if self.banks:
            banks = study.select_bank(self.env, selection, self.jobs)
            save_results(self.out / "banks", study.bank_table(banks), banks)
            return
        rules = study.RULES[self.env] if self.rules is None else self.rules
        if self.quick:
            rules = rules[0], study.TOLD[self.env][0]
        given = self.agents, rules, episodes, selection, self.jobs
        if self.worlds:
            found = {
                name: study.evaluate(study.ROAD, *given, changes)
                for name, changes in study.WORLDS.items()
            }
            save_results(self.out / "worlds", study.world_table(found, self.agents), found)
            return
        rows = study.evaluate(self.env, *given)
        names = () if self.quick else study.TOLD[self.env]
        told = joblib.delayed(study.told)
        calls = [told(self.env, name, episodes, selection) for name in names]
        rewards = in_parallel(calls, self.jobs, "told")
        rows += [
            {"decider": f"{name}, told the motion", "reward": reward}
            for name, reward in zip(names, rewards, strict=True)
        ]
        save_results(self.out / "road", study.markdown(rows), rows, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Road, "python -m studies.road"))
