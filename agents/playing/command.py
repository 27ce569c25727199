"""The command `hybridtrack play`: watch a decider in a window, or save the episode as a file."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
from PIL import Image
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from agents.evaluation.deciders import load_decider
from agents.interface.output_files import atomic_file
from agents.interface.progress import progress_display
from agents.interface.recording_files import write_table
from agents.interface.world_arguments import WorldArguments
from agents.playing.animation import write_gif
from agents.playing.evidence import DeciderEvidence, decider_evidence
from baselines.deciders.decider import Decider
from hybrid_env.checks import ArgumentError, check_integer, reject
from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.env import HybridTrackEnv
from hybrid_env.registration import check_env_id
from hybrid_env.rendering.figure import RENDER_FPS, Renderer
from hybrid_env.rendering.history import EpisodeHistory
from hybrid_env.rendering.modes import mode_name
from hybrid_env.rendering.window import display_available

FINAL_FRAMES = 2 * RENDER_FPS
"""Number of times that the window shows the last frame of an episode: for two seconds."""


@dataclass(kw_only=True)
class Play(WorldArguments):
    """Watch a decider on one track in a window, or save the episode as an animation, picture or recording."""

    decider: str = "ate"
    """A rule of `compare` such as 'ate' or 'msprt', 'shipped', or a run folder; optionally ':threshold'."""
    episodes: int = 1
    """Number of episodes."""
    seed: int = 0
    """Seed of the first episode; it increases by one with each episode."""
    out: Path | None = None
    """A .gif file for all episodes, or a .png file for the end of a single one; without it a window opens."""
    record: Path | None = None
    """A .csv file for the measurements of one episode, columns t,x,y, as `hybridtrack track` reads it."""

    def run(self) -> None:
        """Play the episodes, print a table after each, and write the requested files.

        Raises:
            ArgumentError: one line that names the argument, its value and what is allowed.
        """
        self._check()
        show = self.out is None and (self.record is None or display_available())
        if show and not display_available():
            raise ArgumentError("no window can be opened here: use --out FILE with a .gif or .png file")
        env = self._make_env()
        decider = load_decider(self.decider, env.options)
        evidence = decider_evidence(decider)
        renderer = Renderer(env.options, show, evidence.panel)
        console = Console(emoji=False)
        try:
            with progress_display(console) as progress:
                histories = self._play(env, decider, evidence, console, progress)
                if not self._render(renderer, histories):
                    return
        finally:
            renderer.close()
        for path in (self.out, self.record):
            if path is not None:
                size = path.stat().st_size / 1024
                console.print(f"{path}: {size:.0f} KiB", markup=False, highlight=False, soft_wrap=True)

    def _check(self) -> None:
        check_integer("episodes", self.episodes)
        check_integer("seed", self.seed, minimum=0)
        for name, suffixes in (("out", (".gif", ".png")), ("record", (".csv",))):
            path = getattr(self, name)
            if path is None:
                continue
            if path.suffix.lower() not in suffixes:
                raise reject(name, str(path), f"a file name that ends in {' or '.join(suffixes)}")
            if not path.parent.is_dir():
                raise reject(name, str(path), "a file in an existing folder")
            if path.is_dir():
                raise reject(name, str(path), "a file, not a folder")
            if self.episodes > 1 and path.suffix.lower() != ".gif":
                raise reject("episodes", self.episodes, f"1 with --{name} {path}, which holds one episode")

    def _make_env(self) -> HybridTrackEnv:
        env_id, options = self.world_of(self.decider)
        check_env_id(env_id)
        env = gym.make(env_id, render_mode="rgb_array", **options).unwrapped
        assert isinstance(env, HybridTrackEnv)
        return env

    def _play(
        self,
        env: HybridTrackEnv,
        decider: Decider,
        evidence: DeciderEvidence,
        console: Console,
        progress: Progress,
    ) -> Iterator[EpisodeHistory]:
        """Play the episodes; yield the history after every reset and every step."""
        history = env.history
        assert history is not None
        segments = env.options.segments
        task = progress.add_task("Playing", total=self.episodes * segments, note="")
        for episode in range(self.episodes):
            observation, _ = env.reset(seed=self.seed + episode)
            start, state, terminated = np.ones(1, np.bool_), None, False
            while not terminated:
                rows = observation[None]
                history.set_evidence(evidence.compute(rows, state, start)[0])
                actions, state = decider.predict(rows, state, start, deterministic=True)
                yield history
                start = np.zeros(1, np.bool_)
                observation, _, terminated, _, _ = env.step(int(actions[0]))
                done = episode * segments + len(history.decisions)
                progress.update(task, completed=done, note=f"tick {len(history.trace)}")
            title = f"{self.decider}, episode {episode + 1}, seed {self.seed + episode}"
            console.print(episode_table(history, title))
            if self.record is not None:
                write_recording(self.record, history)
            yield history

    def _render(self, renderer: Renderer, histories: Iterator[EpisodeHistory]) -> bool:
        """Show or write the frames; return False if the user has closed the window before the end."""
        if self.out is not None and self.out.suffix.lower() == ".gif":
            write_gif(self.out, (renderer.draw(history) for history in histories), renderer.options)
            return True
        for history in histories:
            if renderer.window is not None:
                for _ in range(FINAL_FRAMES if history.finished else 1):
                    renderer.draw(history)
                if renderer.window.closed_by_user:
                    return False
        if self.out is not None:
            with atomic_file(self.out) as part:
                Image.fromarray(renderer.draw(history)).save(part, format="PNG")
        return True


def episode_table(history: EpisodeHistory, title: str) -> Table:
    """Return a table with one row for each decision of an episode."""
    radii = history.options.radii
    table = Table(title=escape(title), title_justify="left")
    for name in ("segment", "true mode", "decided mode", "decision"):
        table.add_column(name)
    table.add_column("ticks", justify="right")
    for number, decision in enumerate(history.decisions, start=1):
        verdict = "[green]correct[/]" if decision.correct else "[red]wrong[/]"
        table.add_row(
            str(number),
            mode_name(decision.true_mode, radii),
            mode_name(decision.mode, radii),
            verdict + (", forced" if decision.forced else ""),
            f"{decision.ticks} of {decision.length}",
        )
    return table


def write_recording(path: Path, history: EpisodeHistory) -> None:
    """Write the measurements of an episode as CSV: t [s], which starts at tau, and x and y [m]."""
    ticks = np.arange(1, len(history.trace) + 1)
    # rounding to 12 digits gives 0.3 instead of 0.30000000000000004
    times = [float(f"{time:.12g}") for time in history.options.tau * ticks]
    x, y = (history.trace[:, TRACE_COLUMNS.index(name)] for name in ("measured_x", "measured_y"))
    write_table(path, {"t": times, "x": x, "y": y})
