"""The command `hybridtrack limits`: attainable decision times of the classical rules on each filter bank."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from agents.evaluation import seeds
from agents.interface.help_texts import shown_default
from hybrid_env.checks import check_integer, reject

QUICKEST = "HybridTrackQuickest-v0"


@dataclass(kw_only=True)
class Limits:
    """Evaluate every classical rule on every filter bank and noise level.

    The default takes about two hours on one core, 1,500 episodes one hour. With
    --env HybridTrackQuickest-v0, rules for unknown switch moments are evaluated, in about an hour.
    """

    env: Annotated[str | None, shown_default("both environments with known switch moments")] = None
    """'HybridTrackQuickest-v0'."""
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png."""

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files.

        Raises:
            ArgumentError: an argument is out of range, or the output folder cannot be written.
        """
        check_integer("episodes", self.episodes, minimum=10)
        check_integer("seed", self.seed, minimum=0)
        if self.env is not None:
            self._run_statements(self.env)
            return
        from agents.limits.study import CALIBRATION_EPISODES

        if self.seed + max(self.episodes, CALIBRATION_EPISODES) > seeds.SELECTION:
            raise reject(
                "seed",
                self.seed,
                f"at most {seeds.SELECTION} minus the number of episodes, at least {CALIBRATION_EPISODES}",
            )
        from rich.console import Console
        from rich.markdown import Markdown

        from agents.interface.output_files import atomic_file, output_folder, write_json
        from agents.interface.progress import progress_display
        from agents.limits.figure import draw_decision_times
        from agents.limits.report import calibration_markdown, rules_markdown, type_accuracy_markdown
        from agents.limits.steps import STEPS, evaluate_steps, steps_markdown
        from agents.limits.study import (
            BANK_ENV,
            BANKS,
            CALIBRATION_BANKS,
            NOISE_LEVELS,
            RULES,
            THREE_MODE_ENV,
            bank_calibration,
            evaluate_rules,
            type_accuracy_golubkov2018,
        )

        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        rules = sum(map(len, RULES.values()))
        with progress_display(console) as progress:
            per_noise = len(BANKS) * rules + 2 * len(STEPS) + len(CALIBRATION_BANKS) + 2
            total = len(NOISE_LEVELS) * per_noise
            task = progress.add_task("Evaluating", total=total, note="")

            def advance(note: str) -> None:
                progress.update(task, advance=1, note=note)

            steps = [
                one
                for env_id in (THREE_MODE_ENV, BANK_ENV)
                for one in evaluate_steps(env_id, self.episodes, self.seed, advance)
            ]
            found = [
                one
                for env_id in (THREE_MODE_ENV, BANK_ENV)
                for one in evaluate_rules(env_id, self.episodes, self.seed, advance)
            ]
            calibration = bank_calibration(self.seed, advance)
            accuracies = type_accuracy_golubkov2018(self.episodes, self.seed, advance)
            progress.update(task, note="")
        text = "\n".join(
            [
                steps_markdown(steps),
                rules_markdown(found),
                calibration_markdown(calibration),
                type_accuracy_markdown(accuracies),
            ]
        )
        console.print(Markdown(text))
        with atomic_file(folder / "limits.md") as part:
            part.write_text(text, encoding="utf-8")
        write_json(
            folder / "limits.json",
            {
                "rules": [
                    asdict(one)
                    | {name: getattr(one, name).as_json() for name in ("time_95", "time_98", "reward")}
                    for one in found
                ],
                "steps": [asdict(one) for one in steps],
                "calibration": [asdict(one) for one in calibration],
                "golubkov2018": [asdict(one) for one in accuracies],
            },
        )
        draw_decision_times(found, folder / "limits.png")
        console.print(f"Files in {folder}: limits.md, limits.json, limits.png", markup=False, highlight=False)

    def _run_statements(self, env_id: str) -> None:
        if env_id.removeprefix("hybrid_env:") != QUICKEST:
            raise reject("env", env_id, f"{QUICKEST}, or no --env for the others")
        if self.seed + self.episodes > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION} minus the number of episodes")
        from agents.limits.statement_command import run_statement_limits

        run_statement_limits(self.episodes, self.seed, self.out)
