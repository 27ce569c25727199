"""The command `hybridtrack limits`: attainable decision times of the classical rules on each filter bank."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from agents.interface.help_texts import shown_default
from agents.interface.parallel_arguments import ParallelArguments
from baselines.rules import seeds
from hybrid_env.checks import check_integer, reject

if TYPE_CHECKING:
    from agents.interface.parallel import Call, Workers

QUICKEST = "HybridTrackQuickest-v0"


@dataclass(kw_only=True)
class Limits(ParallelArguments):
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
        workers = self.workers()
        if self.env is not None:
            self._run_statements(self.env, workers)
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
        from agents.limits.steps import step_calls, steps_markdown, with_gains
        from agents.limits.study import (
            BANK_ENV,
            THREE_MODE_ENV,
            calibration_calls,
            rule_calls,
            type_accuracy_calls,
        )

        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        ids = (THREE_MODE_ENV, BANK_ENV)
        parts: dict[str, dict[str, Call]] = {
            "steps": _joined(step_calls(env_id, self.episodes, self.seed) for env_id in ids),
            "rules": _joined(rule_calls(env_id, self.episodes, self.seed) for env_id in ids),
            "calibration": calibration_calls(self.seed),
            "accuracy": type_accuracy_calls(self.episodes, self.seed),
        }
        with progress_display(console) as progress:
            calls = _joined(parts.values())
            task = progress.add_task("Evaluating", total=len(calls), note="")
            results = dict(workers.results(calls, lambda note: progress.update(task, advance=1, note=note)))
            progress.update(task, note="")
        by_part = {part: [results[name] for name in calls] for part, calls in parts.items()}
        steps, found, accuracies = with_gains(by_part["steps"]), by_part["rules"], by_part["accuracy"]
        calibration = [one for results in by_part["calibration"] for one in results]
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

    def _run_statements(self, env_id: str, workers: "Workers") -> None:
        if env_id.removeprefix("hybrid_env:") != QUICKEST:
            raise reject("env", env_id, f"{QUICKEST}, or no --env for the others")
        if self.seed + self.episodes > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION} minus the number of episodes")
        from agents.limits.statement_command import run_statement_limits

        run_statement_limits(self.episodes, self.seed, self.out, workers)


def _joined(parts: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Join dictionaries with different keys."""
    return {name: value for part in parts for name, value in part.items()}
