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
from typing import Any
from unittest import mock

import numpy as np

from studies.simulators.aircraft import FOOT, SETTLED, Aircraft
from studies.simulators.vehicles import CONTROL, FloatArray, Path, flown_path


class Airliner(Aircraft):
    """An airliner of BlueSky; the attributes are those of `Aircraft`, with the type designator
    as its name.
    """

    simulator = "BlueSky"
    block_size = 20

    def paths(self, block: int, duration: float) -> list[Path]:
        """See `Vehicle.paths`; the airliners are far from each other."""
        count = round(duration / CONTROL)
        drawn = []
        for seed in range(block * self.block_size, (block + 1) * self.block_size):
            generator = np.random.default_rng(seed)
            modes, banks = self.commands(count, generator)
            heading = generator.uniform(0.0, 360.0)
            drawn.append((modes, banks, heading, self.speeds(len(banks), generator)))
        every_mode, *commands = zip(*drawn, strict=True)
        banks, headings, speeds = map(np.array, commands)
        velocities = self._fly_all(headings, banks.T, speeds.T)
        return list(map(flown_path, velocities.swapaxes(0, 1)[:, SETTLED:], every_mode))

    def speeds(
        self,
        count: int,
        generator: np.random.Generator,
        lasting: float = 120.0,
        spread: float = 0.15,
    ) -> FloatArray:
        """Return the commanded calibrated airspeeds (count,) at every correction [knots]: they last
        a mean time [s], and differ from the nominal one by up to a share.
        """
        switched = generator.random(count) < CONTROL / lasting
        switched[0] = True
        factors = generator.uniform(1.0 - spread, 1.0 + spread, count)
        return self.airspeed * factors[switched][np.cumsum(switched) - 1]

    def _fly_all(
        self,
        headings: FloatArray,
        banks: FloatArray,
        speeds: FloatArray,
        ahead: float = 90.0,
        renewed: float = 10.0,
    ) -> FloatArray:
        """Return velocities east and north after every command, (n, N, 2) [m/s].

        Args:
            headings: (N,) at the begin [deg].
            banks: (n, N) commanded, right positive [deg].
            speeds: (n, N) commanded [knots].
            ahead: a turn is commanded by headings so far ahead [deg].
            renewed: time after which they are commanded anew [s].
        """
        velocities = np.empty((*banks.shape, 2))
        names = [f"HT{track:03d}" for track in range(len(headings))]
        with _bluesky() as simulator:
            traffic = simulator.traf
            command = simulator.stack.stack
            ones = np.ones(len(names))
            traffic.cre(
                names,
                self.name,
                0.5 * np.arange(len(names)),
                0.0 * ones,
                headings,
                self.height * FOOT * ones,
                # From knots to m/s.
                speeds[0] * 0.514444,
            )
            command(f"DT {CONTROL}")
            simulator.sim.step()
            begun = np.zeros(len(names), np.int64)
            last = np.full((2, len(names)), np.nan)
            for k, (bank, speed) in enumerate(zip(banks, speeds, strict=True)):
                commanded = np.array([bank, speed])
                switched, faster = commanded != last
                begun[switched] = k
                turning = bank != 0.0
                renews = (k - begun) % round(renewed / CONTROL) == 0
                headings = traffic.hdg + ahead * np.sign(bank)
                for track, name in enumerate(names):
                    if switched[track] or (renews & turning)[track]:
                        if turning[track]:
                            command(f"BANK {name} {abs(bank[track])}")
                        command(f"HDG {name} {headings[track] % 360.0}")
                    if faster[track]:
                        command(f"SPD {name} {speed[track]}")
                last = commanded
                simulator.sim.step()
                velocities[k] = np.column_stack([traffic.gseast, traffic.gsnorth])
        return velocities


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
