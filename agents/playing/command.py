"""The command `hybridtrack play`: watch a decider on one track, or keep the episode as a file."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from agents.evaluation.deciders import load_decider
from agents.interface.output_files import whole_file
from agents.interface.progress import progress_display
from agents.interface.recording_files import write_table
from agents.interface.world_arguments import WorldArguments
from baselines.deciders.decider import Decider
from hybrid_env.checks import ArgumentError, check_integer, reject
from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.env import HybridTrackEnv
from hybrid_env.options import WorldOptions
from hybrid_env.registration import check_env_id
from hybrid_env.rendering.figure import RENDER_FPS
from hybrid_env.rendering.history import EpisodeHistory
from hybrid_env.rendering.modes import mode_colour, mode_name, shade
from hybrid_env.rendering.window import display_available

Frame = NDArray[np.uint8]

LAST_FRAME = 2.0
"""Time for which the window shows a finished episode [s]."""

PALETTE_SIZE = 255  # GIF has 256, one of them for "unchanged"


@dataclass(kw_only=True)
class Play(WorldArguments):
    """Watch a decider on one track in a window, or keep what it did as an animation, picture or recording."""

    decider: str = "ate"
    """Who decides: 'ate', 'msprt' or another rule of `compare`, or a run folder; maybe with ':threshold'."""
    episodes: int = 1
    """Episodes to play, one after the other."""
    seed: int = 0
    """Seed of the first episode; each further one has the next."""
    out: Path | None = None
    """A .gif of all episodes, or a .png of a single finished one; without it a window opens."""
    record: Path | None = None
    """A .csv for the measurements of one episode, columns t,x,y, which `hybridtrack track` reads."""

    def run(self) -> None:
        """Play, print a table after each episode, write the files that were asked for.

        Raises:
            ArgumentError: one line that names the argument, its value and what is allowed.
        """
        self._check()
        env = self._make_env()
        console = Console()
        try:
            decider = load_decider(self.decider, env.options)
            with progress_display(console) as progress:
                if not self._play(env, self._steps(env, decider, console, progress)):
                    return
        finally:
            env.close()
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
                raise reject(name, str(path), f"a file that ends in {' or '.join(suffixes)}")
            if not path.parent.is_dir():
                raise reject(name, str(path), "a file in a folder that exists")
            if path.is_dir():
                raise reject(name, str(path), "a file, not a folder")
            if self.episodes > 1 and path.suffix.lower() != ".gif":
                raise reject("episodes", self.episodes, f"1 with --{name} {path}, which holds one episode")

    def _make_env(self) -> HybridTrackEnv:
        wants_window = self.out is None and (self.record is None or display_available())
        mode = "human" if wants_window else "rgb_array"
        if mode == "human" and not display_available():
            raise ArgumentError("no window can be opened here: give --out FILE, a .gif or a .png")
        env_id, options = self.world_of(self.decider)
        check_env_id(env_id)
        env = gym.make(env_id, render_mode=mode, **options).unwrapped
        assert isinstance(env, HybridTrackEnv)
        return env

    def _play(self, env: HybridTrackEnv, steps: Iterator[None]) -> bool:
        """Play to the end and write the picture; False if the user closed the window before."""
        try:
            if self.out is not None and self.out.suffix.lower() == ".gif":
                write_gif(self.out, (env.render() for _ in steps), env.options)
                return True
            for _ in steps:
                if window_closed(env):
                    return False
            if self.out is not None:
                with whole_file(self.out) as part:
                    Image.fromarray(env.render()).save(part, format="PNG")
        except OSError as error:
            raise ArgumentError(
                f"{self.out or self.record} cannot be written: {error.strerror or error}"
            ) from None
        return True

    def _steps(
        self, env: HybridTrackEnv, decider: Decider, console: Console, progress: Progress
    ) -> Iterator[None]:
        """Play the episodes; every reset and every step is followed by one yield."""
        history = env.history
        assert history is not None
        segments = env.options.segments
        task = progress.add_task("Playing", total=self.episodes * segments, note="")
        for episode in range(self.episodes):
            observation, _ = env.reset(seed=self.seed + episode)
            start, state, terminated = np.ones(1, np.bool_), None, False
            yield
            while not terminated:
                actions, state = decider.predict(observation[None], state, start, deterministic=True)
                start = np.zeros(1, np.bool_)
                observation, _, terminated, _, _ = env.step(int(actions[0]))
                done = episode * segments + len(history.decisions)
                progress.update(task, completed=done, note=f"tick {len(history.trace)}")
                yield
            title = f"{self.decider}, episode {episode + 1}, seed {self.seed + episode}"
            console.print(episode_table(history, title))
            if self.record is not None:
                write_recording(self.record, history)
            if env.render_mode == "human":
                for _ in range(round(LAST_FRAME * RENDER_FPS)):
                    env.render()


def window_closed(env: HybridTrackEnv) -> bool:
    """Whether the user has closed the window of an environment."""
    window = None if env.renderer is None else env.renderer.window
    return window is not None and window.closed_by_user


def episode_table(history: EpisodeHistory, title: str) -> Table:
    """One row for each decision of an episode."""
    radii = history.options.radii
    table = Table(title=title, title_justify="left")
    for name in ("segment", "true mode", "decided mode", "decision"):
        table.add_column(name)
    table.add_column("ticks", justify="right")
    for number, made in enumerate(history.decisions, start=1):
        verdict = "[green]correct[/]" if made.correct else "[red]wrong[/]"
        table.add_row(
            str(number),
            mode_name(made.true_mode, radii),
            mode_name(made.mode, radii),
            verdict + (", forced" if made.forced else ""),
            f"{made.ticks} of {made.length}",
        )
    return table


def write_recording(path: Path, history: EpisodeHistory) -> None:
    """Write the measurements of an episode as CSV: t [s], which starts at tau, x and y [m]."""
    ticks = np.arange(1, len(history.trace) + 1)
    # 12 digits, so that 3 tau is 0.3 and not 0.30000000000000004
    times = [float(f"{time:.12g}") for time in history.options.tau * ticks]
    x, y = (history.trace[:, TRACE_COLUMNS.index(name)] for name in ("measured_x", "measured_y"))
    write_table(path, {"t": times, "x": x, "y": y})


def write_gif(path: Path, frames: Iterator[Frame], options: WorldOptions) -> None:
    """Write frames, (height, width, 3) uint8, as an endless animation of RENDER_FPS frames a second."""
    palette = Image.new("P", (1, 1))
    palette.putpalette(palette_colours(options).tobytes())
    images = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    with whole_file(path) as part:
        next(images).save(
            part,
            format="GIF",
            save_all=True,
            append_images=images,
            duration=round(1000 / RENDER_FPS),
            loop=0,
        )


def palette_colours(options: WorldOptions) -> NDArray[np.uint8]:
    """The colours of a frame and their mixtures with white, (n, 3), n <= PALETTE_SIZE.

    One palette for all frames, fixed beforehand, keeps a picture steady and its changes small.
    """
    greys = [f"#{level:02x}{level:02x}{level:02x}" for level in range(0, 256, 17)]
    marks = [shade("#f0e442", amount) for amount in (-0.75, -0.5, -0.25, 0.0, 0.5)]
    modes = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
    room = PALETTE_SIZE - len(greys) - len(marks)
    steps = min(max(room // len(modes), 1), 12)
    mixed = [shade(colour, step / steps) for step in range(steps) for colour in modes]
    colours = [*greys, *marks, *mixed[:room]]
    return np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in colours], np.uint8)
