"""The command `hybridtrack limits`: how far any rule gets on each bank, and what limits ATE."""

from dataclasses import asdict, dataclass
from pathlib import Path

from agents.evaluation import seeds
from hybrid_env.checks import check_integer, reject


@dataclass(kw_only=True)
class Limits:
    """Measure every classical rule on every bank over the noise: some minutes for the default."""

    episodes: int = 3000
    """Episodes that every rule is measured on; thresholds are chosen on a third as many others."""
    seed: int = 0
    """Of the first episode."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png."""

    def run(self) -> None:
        """Measure, write the files."""
        check_integer("episodes", self.episodes, minimum=10)
        check_integer("seed", self.seed, minimum=0)
        from agents.limits.study import STATEMENT_EPISODES

        if self.seed + max(self.episodes, STATEMENT_EPISODES) > seeds.SELECTION:
            raise reject(
                "seed",
                self.seed,
                f"at most {seeds.SELECTION} less the episodes, {STATEMENT_EPISODES} at least",
            )
        from rich.console import Console
        from rich.markdown import Markdown

        from agents.interface.output_files import output_folder, whole_file, write_json
        from agents.interface.progress import progress_display
        from agents.limits.report import classes_markdown, draw_limits, limits_markdown, statements_markdown
        from agents.limits.study import (
            BANK,
            BANKS,
            NOISE,
            RULES,
            SINGLE,
            STATEMENTS,
            classes_2018,
            rules_on_banks,
            statements,
        )

        folder = output_folder("out", self.out)
        console = Console()
        rules = sum(map(len, RULES.values()))
        with progress_display(console) as progress:
            total = len(NOISE) * (len(BANKS) * rules + len(STATEMENTS) + 2)
            task = progress.add_task("Measuring", total=total, note="")

            def advance(note: str) -> None:
                progress.update(task, advance=1, note=note)

            found = [
                one
                for env_id in (SINGLE, BANK)
                for one in rules_on_banks(env_id, self.episodes, self.seed, advance)
            ]
            told = statements(self.seed, advance)
            classes = classes_2018(self.episodes, self.seed, advance)
            progress.update(task, note="")
        parts = [
            limits_markdown(found),
            "### Right / stated probability of the likeliest hypothesis, %\n\nHybridTrack-v0, all waiting; "
            "in brackets stated less actual in the worst bin of the stated.\n\n" + statements_markdown(told),
            "### The gap rule at ln 99 on the scheme of Golubkov 2018\n\n" + classes_markdown(classes),
        ]
        text = "\n".join(parts)
        console.print(Markdown(text))
        with whole_file(folder / "limits.md") as part:
            part.write_text(text, encoding="utf-8")
        write_json(
            folder / "limits.json",
            {
                "limits": [
                    asdict(one)
                    | {name: getattr(one, name).as_json() for name in ("time_95", "time_98", "reward")}
                    for one in found
                ],
                "statements": [asdict(one) for one in told],
                "classes": [asdict(one) for one in classes],
            },
        )
        draw_limits(found, folder / "limits.png")
        console.print(f"Files in {folder}: limits.md, limits.json, limits.png", highlight=False)
