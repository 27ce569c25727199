"""Airliners of the air traffic simulator BlueSky, which commanded headings fly through turns.

Hoekstra & Ellerbroek 2016, "BlueSky ATC simulator project: an open data and open source approach",
ICRAT. Its performance model OpenAP (Sun, Hoekstra & Ellerbroek 2020) limits speeds and
accelerations. Unlike the object of the environments, an airliner is told another speed every two
minutes on average, and reaches it in half a minute; its bank, not its radius, is given, so that the
radius follows the square of the speed. BlueSky is a module of its own. Its
airliners turn without rolling first.
"""

import contextlib
import functools
import io
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from studies.simulators.aircraft import FOOT, SETTLED, Aircraft, draw_commands
from studies.simulators.paths import CONTROL, Path, flown_path

# [m/s]
KNOT = 0.514444
# Airliners that are simulated at the same time, far from each other.
TOGETHER = 20
# Mean time between two commanded speeds [s].
SPEED_TIME = 120.0
# A commanded speed differs from the nominal one by up to this share.
SPEED_SPREAD = 0.15
# A turn is commanded by headings so far ahead [deg].
AHEAD = 90.0
# Time after which they are commanded anew [s].
RENEWED = 10.0


@dataclass(frozen=True)
class Airliner(Aircraft):
    """An airliner of BlueSky; the attributes are those of `Aircraft`, with the type designator
    as its name.
    """

    simulator: ClassVar[str] = "BlueSky"
    module: ClassVar[str] = "bluesky"

    def travel(self, seed: int, duration: float) -> Path:
        """See `Aircraft.travel`."""
        return _fly_together(self, seed // TOGETHER, duration)[seed % TOGETHER]


AIRLINERS = {
    "regional jet": Airliner(
        "E190",
        10000.0,
        250.0,
        148.5,
        25.0,
        1.0,
        (0.8, 1.6, 3.2),
        (20.0, 80.0, 320.0),
    ),
    "narrow-body": Airliner(
        "A320",
        20000.0,
        270.0,
        186.1,
        25.0,
        1.0,
        (0.8, 1.6, 3.2),
        (20.0, 100.0, 500.0),
    ),
    "wide-body": Airliner(
        "B744",
        30000.0,
        270.0,
        217.0,
        20.0,
        1.0,
        (1.6, 3.2, 6.4),
        (20.0, 100.0, 500.0),
    ),
}


@contextlib.contextmanager
def _bluesky() -> Iterator[Any]:
    """Give BlueSky with no traffic at time 0. It prints nothing, and reads no waypoints, which
    take long.
    """
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore", DeprecationWarning)
        # Loaded where it is used: few have it.
        from bluesky.navdatabase import Navdatabase

        with mock.patch.object(Navdatabase, "reset"):
            simulator = _started()
            simulator.sim.reset()
            yield simulator


@functools.cache
def _started() -> Any:
    """Return BlueSky, which starts once in a process."""
    import bluesky

    # Else it makes one in the home.
    with tempfile.TemporaryDirectory() as folder:
        bluesky.init(mode="sim", detached=True, workdir=folder)
    return bluesky


@functools.lru_cache(maxsize=8)
def _fly_together(craft: Airliner, block: int, duration: float) -> list[Path]:
    """Return the flights of `TOGETHER` successive seeds."""
    count = round(duration / CONTROL)
    settled = round(SETTLED / CONTROL)
    modes = []
    banks = []
    headings = []
    speeds = []
    for track in range(TOGETHER):
        generator = np.random.default_rng(block * TOGETHER + track)
        mode, bank = draw_commands(craft, count, generator)
        modes.append(mode)
        banks.append(np.append(np.zeros(settled), bank))
        headings.append(generator.uniform(0.0, 360.0))
        speeds.append(draw_speeds(craft, settled + count, generator))
    velocities = _fly(
        craft,
        np.array(headings),
        np.array(banks),
        np.array(speeds),
    )[settled:]
    return [flown_path(velocities[:, track], modes[track]) for track in range(TOGETHER)]


def draw_speeds(craft: Airliner, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return the commanded calibrated airspeeds (count,) at every correction [knots]."""
    told = generator.random(count) < CONTROL / SPEED_TIME
    told[0] = True
    factors = generator.uniform(1.0 - SPEED_SPREAD, 1.0 + SPEED_SPREAD, count)
    return np.asarray(craft.airspeed * factors[told][np.cumsum(told) - 1])


def _fly(
    craft: Airliner,
    headings: NDArray[np.float64],
    banks: NDArray[np.float64],
    speeds: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return velocities east and north after every command, (n, N, 2) [m/s].

    Args:
        craft: of all.
        headings: (N,) at the begin [deg].
        banks: (N, n) commanded, right positive [deg].
        speeds: (N, n) commanded [knots].
    """
    found = np.empty((banks.shape[1], len(headings), 2))
    names = [f"HT{track:03d}" for track in range(len(headings))]
    with _bluesky() as simulator:
        traffic = simulator.traf
        command = simulator.stack.stack
        north = 0.5 * np.arange(len(names))
        alike = np.ones(len(names))
        traffic.cre(
            names,
            craft.name,
            north,
            0.0 * alike,
            headings,
            craft.height * FOOT * alike,
            speeds[:, 0] * KNOT,
        )
        command(f"DT {CONTROL}")
        simulator.sim.step()
        begun = np.zeros(len(names), np.int64)
        told = np.zeros((2, len(names)))
        for k, (bank, speed) in enumerate(zip(banks.T, speeds.T, strict=True)):
            switched = (bank != told[0]) | (k == 0)
            begun[switched] = k
            turned = (k - begun) % round(RENEWED / CONTROL) == 0
            for track in np.flatnonzero(switched | (turned & (bank != 0.0))).tolist():
                if bank[track] != 0.0:
                    command(f"BANK {names[track]} {abs(bank[track])}")
                heading = traffic.hdg[track] + AHEAD * np.sign(bank[track])
                command(f"HDG {names[track]} {heading % 360.0}")
            for track in np.flatnonzero(speed != told[1]).tolist():
                command(f"SPD {names[track]} {speed[track]}")
            told = np.array([bank, speed])
            simulator.sim.step()
            found[k] = np.stack([traffic.gseast, traffic.gsnorth], axis=1)
    return found
