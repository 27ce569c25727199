"""The command `hybridtrack play`: watch a decider in a window, or save the episode as a picture,
GIF or page.
"""

import csv
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from string import Template
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import Progress

from agents.evaluation.episodes import Episodes, episode_table
from agents.evaluation.registry import ErrorArguments, check_name
from agents.evaluation.task import task_of
from agents.interface.help_texts import shown_default
from agents.interface.output_files import atomic_file, finite
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments, WorldArguments
from hybrid_env.checks import ArgumentError, Count, NotNegative, reject
from hybrid_env.extras import explained
from hybrid_env.rendering import FRAME_SIZE, METADATA
from hybrid_env.rendering.evidence import legend_colours, mode_colour, mode_name
from hybrid_env.rendering.frame import draw_frame
from hybrid_env.rendering.history import History


@dataclass(kw_only=True)
class Play(WorldArguments, ErrorArguments, TrustArguments):
    """Watch a decider on one track in a window, or save the episode as an animation, picture,
    page for a browser or recording.
    """

    deciders: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        shown_default("ate; threshold in HybridTrackQuickest-v0; on a page also shipped"),
    ] = ()
    """'shipped', a run folder, 'model.zip', 'mine.py:MyRule' or a rule, with an optional
    ':threshold'. A page shows several on the same episode. Announced switches: {announced}. Unknown
    switches: {unknown}.
    """
    episodes: Count = 1
    """Number of episodes."""
    seed: NotNegative = 0
    """Seed of the first episode; it increases by one with each episode."""
    out: Annotated[Path | None, shown_default("a window")] = None
    """A .gif file for all episodes, a .png file for the end of a single one, or an .html file with
    a slider over its ticks, which needs the extra 'html' and no network.
    """
    record: Annotated[Path | None, shown_default("none is written")] = None
    """A .csv file for the measurements of one episode, columns t [s], x [m] and y [m], for
    `hybridtrack track`; without a window.
    """

    def run(self) -> None:
        """Play the episodes, print a table after each, and write the requested files."""
        self._check()
        task = task_of(*self.world_of("".join(self.deciders[:1])))
        names = self.deciders or (task.reference, *task.shipped)[: 2 if self._is_page else 1]
        for name in names:
            check_name(name, task.switches)
        posteriors = self._is_page and task.waits
        every = [Episodes(task, self.at_error(name), of_filters=posteriors) for name in names]
        console = Console(emoji=False)
        with progress_display(console) as progress:
            histories = self._play(every, console, progress)
            if self.out is not None and self._is_page:
                # Plays the episodes.
                list(histories)
                write_page(self.out, every, f"{task.title}, seed {self.seed}")
            elif self.out is not None and self.out.suffix == ".gif":
                write_gif(self.out, (draw_frame(history) for history in histories))
            elif self.out is not None:
                *_, history = histories
                with atomic_file(self.out) as part:
                    Image.fromarray(draw_frame(history)).save(part, format="PNG")
            elif self.record is not None:
                # Plays the episode.
                list(histories)
            elif not show(histories):
                return
        for path in (self.out, self.record):
            if path is not None:
                print_lines(console, f"{path}: {path.stat().st_size / 1024:.0f} KiB")

    @property
    def _is_page(self) -> bool:
        return self.out is not None and self.out.suffix == ".html"

    def _check(self) -> None:
        suffixes = {"out": (".gif", ".png", ".html"), "record": (".csv",)}
        for name, path in (("out", self.out), ("record", self.record)):
            if path is None:
                continue
            allowed = f"a file in an existing folder, which ends in {' or '.join(suffixes[name])}"
            if path.suffix not in suffixes[name] or not path.parent.is_dir():
                raise reject(name, str(path), allowed)
            if self.episodes > 1 and path.suffix != ".gif":
                allowed = f"1 with --{name} {path}, which holds one episode"
                raise reject("episodes", self.episodes, allowed)
        if len(self.deciders) > 1 and not self._is_page:
            raise reject("deciders", self.deciders, "one, or several with --out FILE.html")

    def _play(
        self, every: Sequence[Episodes], console: Console, progress: Progress
    ) -> Iterator[History]:
        """Play the episodes; yield the history after every reset and every step."""
        bar = progress.add_task("Playing", total=self.episodes * len(every), note="")
        for episodes, episode in product(every, range(self.episodes)):
            history, seed = episodes.history, self.seed + episode
            for _ in episodes.play(seed):
                progress.update(bar, note=f"tick {len(history.trace)}")
                yield history
            progress.advance(bar)
            title = f"{episodes.name}, episode {episode + 1}, seed {seed}"
            console.print(episode_table(episodes.task, title, history))
            if self.record is not None:
                write_recording(self.record, history, episodes.env.options.tau)
            yield history


def show(histories: Iterator[History]) -> bool:
    """Show the frames in a window, the end of an episode for two seconds. Returns False if the user
    has closed it before.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    with explained():
        import pygame
    try:
        # Without a display SDL renders off screen.
        displays = map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
        if sys.platform.startswith("linux") and not any(displays):
            raise pygame.error("no display")
        pygame.display.init()
        window = pygame.display.set_mode(FRAME_SIZE)
        clock, rate = pygame.time.Clock(), METADATA["render_fps"]
        for history in histories:
            image = pygame.surfarray.make_surface(draw_frame(history).swapaxes(0, 1))
            for _ in range(2 * rate if history.finished else 1):
                if pygame.event.get(pygame.QUIT):
                    return False
                window.blit(image, (0, 0))
                pygame.display.flip()
                clock.tick(rate)
        return True
    except pygame.error as error:
        raise ArgumentError(
            f"no window can be opened here ({error}): use --out FILE with a .gif or .png file"
        ) from None
    finally:
        pygame.display.quit()


def write_page(path: Path, every: Sequence[Episodes], title: str) -> None:
    """Write the episode that several deciders have played as a page for a browser."""
    from plotly.offline import get_plotlyjs

    history = every[0].history
    of_bank = history.options.all_modes
    modes = range(history.options.hypotheses)
    data = {
        "title": title,
        "names": [mode_name(mode, of_bank) for mode in modes],
        "colours": [mode_colour(mode, of_bank) for mode in modes],
        "legend": legend_colours(of_bank),
        "modes": finite(history.true_modes),
        "truth": finite(history.points().T),
        "measurements": finite(history.points("measured_").T),
        "deciders": [episodes.page_data() for episodes in every],
    }
    # A name cannot end the script.
    text = json.dumps(data).replace("<", "\\u003c")
    # The data and plotly.js are put in.
    page = Template(Path(__file__).with_name("episode.html").read_text(encoding="utf-8"))
    with atomic_file(path) as part:
        part.write_text(page.substitute(library=get_plotlyjs(), episode=text), encoding="utf-8")


def write_recording(path: Path, history: History, tau: float) -> None:
    """Write the measurements of an episode as CSV: t [s], which starts at tau, and x and y [m]."""
    points = history.points("measured_")
    # 0.3 instead of 0.30000000000000004.
    times = [float(f"{tau * tick:.12g}") for tick in range(1, len(points) + 1)]
    rows = [(t, x, y) for t, (x, y) in zip(times, points.tolist(), strict=True) if x == x]
    with atomic_file(path) as part, part.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([("t [s]", "x [m]", "y [m]"), *rows])


def write_gif(path: Path, frames: Iterator[NDArray[np.uint8]]) -> None:
    """Write frames, (height, width, 3) uint8, as an endless animation.

    All frames have the colours of the first one, whose legend has those of the modes: with others
    in each frame, unchanged pixels would flicker.
    """
    first = Image.fromarray(next(frames)).quantize(255)
    images = (
        Image.fromarray(frame).quantize(palette=first, dither=Image.Dither.NONE) for frame in frames
    )
    with atomic_file(path) as part:
        first.save(
            part,
            format="GIF",
            save_all=True,
            append_images=images,
            duration=1000 // METADATA["render_fps"],
            loop=0,
        )
