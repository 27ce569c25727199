"""The command `hybridtrack play`: watch a decider in a window, or save the episode as a picture
or GIF.
"""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import Progress

from agents.evaluation.episodes import episode_table, track_record
from agents.evaluation.registry import ErrorArguments, find_decider, load_decider
from agents.evaluation.task import Task
from agents.evaluation.tasks import task_of
from agents.figures.tracks import TrackRecord
from agents.interface.help_texts import shown_default
from agents.interface.output_files import atomic_file
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments, WorldArguments
from baselines.rules.rollout import rollout
from hybrid_env.checks import ArgumentError, Count, Float32Array, IntArray, NotNegative, reject
from hybrid_env.env import TrackEnv
from hybrid_env.rendering.history import TRACE_INDEX, History
from hybrid_env.rendering.window import RENDER_FPS, Renderer, display_available


class OneTrack:
    """An environment of one track with the interface of a vector environment."""

    num_envs = 1

    def __init__(self, env: TrackEnv):
        self.env, self.world, self.single_action_space = env, env.world, env.action_space

    def reset(self, *, seed: int | None = None) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode."""
        row, info = self.env.reset(seed=seed)
        return row[None], info

    def step(self, actions: IntArray) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the track."""
        row, reward, terminated, truncated, info = self.env.step(int(actions[0]))
        return row[None], np.array([reward]), np.array([terminated]), np.array([truncated]), info


class Episodes:
    """Episodes of a decider on one track; `decider` replaces that of the name, and needs
    `changes` of the options.
    """

    def __init__(self, task: Task, name: str, decider: Any = None, changes: Any = None):
        changes = dict(changes or {})
        if decider is None:
            changes = find_decider(name, task.options).options | changes
        if getattr(task.options, "actions", "all") == "types":
            # Deciders declare hypotheses.
            changes["actions"] = "all"
        self.task, self.name = task.changed(changes), name
        env = gym.make(task.env_id, render_mode="rgb_array", **self.task.given).unwrapped
        assert isinstance(env, TrackEnv)
        self.env, self.decider = (
            env,
            load_decider(name, env.options) if decider is None else decider,
        )

    @property
    def history(self) -> History:
        """The running episode."""
        assert self.env.history is not None
        return self.env.history

    def play(self, seed: int, on_step: Callable[[], None]) -> Iterator[History]:
        """Play an episode; yield its history before every step, with the evidence of the
        decider.
        """
        for now in rollout(OneTrack(self.env), self.decider, seed):
            if now.step:
                on_step()
            if now.terminated[0]:
                return
            self.history.set_evidence(self.decider.evidence(now.seen, now.state, now.starts)[0])
            yield self.history

    def record(self, name: str, seed: int) -> TrackRecord:
        """Play an episode and return what was declared or stated at every tick, with the name in
        the figure.
        """
        for _ in self.play(seed, lambda: None):
            pass
        history = self.history
        truth, measured, estimates = (
            history.trace[:, [TRACE_INDEX[f"{key}x"], TRACE_INDEX[f"{key}y"]]]
            for key in ("", "measured_", "estimate_")
        )
        return track_record(
            self.task,
            history,
            name=name,
            truth=truth,
            measurements=measured,
            true_modes=history.true_modes,
            estimates=estimates,
        )


@dataclass(kw_only=True)
class Play(WorldArguments, ErrorArguments, TrustArguments):
    """Watch a decider on one track in a window, or save the episode as an animation, picture or
    recording.
    """

    decider: Annotated[str | None, shown_default("ate; threshold in HybridTrackQuickest-v0")] = None
    """'shipped', a run folder, 'model.zip', 'mine.py:MyRule' or a rule, with an optional
    ':threshold'. Announced switches: {announced}. Unknown switches: {unknown}.
    """
    episodes: Count = 1
    """Number of episodes."""
    seed: NotNegative = 0
    """Seed of the first episode; it increases by one with each episode."""
    out: Annotated[Path | None, shown_default("a window")] = None
    """A .gif file for all episodes, or a .png file for the end of a single one."""
    record: Annotated[Path | None, shown_default("none is written")] = None
    """A .csv file for the measurements of one episode, columns t,x,y, as `hybridtrack track`
    reads it.
    """

    def run(self) -> None:
        """Play the episodes, print a table after each, and write the requested files."""
        self._check()
        show = self.out is None and (self.record is None or display_available())
        if show and not display_available():
            raise ArgumentError(
                "no window can be opened here: use --out FILE with a .gif or .png file"
            )
        task = task_of(*self.world_of(self.decider or ""))
        episodes = Episodes(task, self.at_error(self.decider or task.reference))
        renderer = Renderer(episodes.env.options, show, episodes.decider.panel())
        console = Console(emoji=False)
        try:
            with progress_display(console) as progress:
                if not self._render(renderer, self._play(episodes, console, progress)):
                    return
        finally:
            renderer.close()
        for path in (self.out, self.record):
            if path is not None:
                print_lines(console, f"{path}: {path.stat().st_size / 1024:.0f} KiB")

    def _check(self) -> None:
        for name, suffixes in (
            ("out", (".gif", ".png")),
            ("record", (".csv",)),
        ):
            path = getattr(self, name)
            if path is None:
                continue
            if path.suffix.lower() not in suffixes or not path.parent.is_dir() or path.is_dir():
                allowed = f"a file in an existing folder, which ends in {' or '.join(suffixes)}"
                raise reject(name, str(path), allowed)
            if self.episodes > 1 and path.suffix.lower() != ".gif":
                raise reject(
                    "episodes",
                    self.episodes,
                    f"1 with --{name} {path}, which holds one episode",
                )

    def _play(self, episodes: Episodes, console: Console, progress: Progress) -> Iterator[History]:
        """Play the episodes; yield the history after every reset and every step."""
        history, task = episodes.history, episodes.task
        bar = progress.add_task("Playing", total=self.episodes, note="")
        for episode in range(self.episodes):
            seed = self.seed + episode
            yield from episodes.play(
                seed,
                lambda: progress.update(bar, note=f"tick {len(history.trace)}"),
            )
            progress.advance(bar)
            title = f"{episodes.name}, episode {episode + 1}, seed {seed}"
            console.print(episode_table(task, title, history))
            if self.record is not None:
                write_recording(self.record, history, episodes.env.options.tau)
            yield history

    def _render(self, renderer: Renderer, histories: Iterator[History]) -> bool:
        """Show or write the frames; return False if the user has closed the window before the
        end.
        """
        if self.out is not None and self.out.suffix.lower() == ".gif":
            write_gif(self.out, (renderer.draw(history) for history in histories))
            return True
        for history in histories:
            if renderer.window is not None:
                # The end of an episode for two seconds.
                for _ in range(2 * RENDER_FPS if history.finished else 1):
                    renderer.draw(history)
                if renderer.window.closed_by_user:
                    return False
        if self.out is not None:
            with atomic_file(self.out) as part:
                Image.fromarray(renderer.draw(history)).save(part, format="PNG")
        return True


def write_recording(path: Path, history: History, tau: float) -> None:
    """Write the measurements of an episode as CSV: t [s], which starts at tau, and x and y [m]."""
    measured = ~np.isnan(history.trace[:, TRACE_INDEX["measured_x"]])
    ticks = np.arange(1, len(history.trace) + 1)[measured]
    # 0.3 instead of 0.30000000000000004.
    times = [float(f"{time:.12g}") for time in tau * ticks]
    x, y = (history.trace[measured, TRACE_INDEX[name]] for name in ("measured_x", "measured_y"))
    rows = zip(times, x.tolist(), y.tolist(), strict=True)
    with atomic_file(path) as part, part.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([("t", "x", "y"), *rows])


def write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], most: int = 1700) -> None:
    """Write frames, (height, width, 3) uint8, as an endless animation with RENDER_FPS frames per
    second; Pillow has at most `most` of them in memory.

    All frames have the colours of the first one, whose legend has those of the modes: with others
    in each frame, unchanged pixels would flicker.
    """
    first = Image.fromarray(next(frames)).quantize(255)

    def others() -> Iterator[Image.Image]:
        for number, frame in enumerate(frames, start=2):
            if number > most:
                allowed = f"at most {most} frames: choose fewer or shorter episodes"
                raise reject("out", str(path), allowed)
            yield Image.fromarray(frame).quantize(palette=first, dither=Image.Dither.NONE)

    with atomic_file(path) as part:
        first.save(
            part,
            format="GIF",
            save_all=True,
            append_images=others(),
            duration=1000 // RENDER_FPS,
            loop=0,
        )
