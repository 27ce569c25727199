"""Cars of the traffic simulator SUMO on road nets that it generates.

Lopez et al. 2018, "Microscopic traffic simulation using SUMO", ITSC. Twenty cars drive at random
through a net, each with its own wish of speed, in each other's way: they change lanes, brake for
corners and for others who have the right of way, and stop. The mode is the yaw rate: a car turns
while it exceeds `TURNING`. SUMO is a program of its own.
"""

import functools
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from studies.simulators.paths import CONTROL, Path

TURNING = 0.1
"""Yaw rate, as mean of `YAW_TIME`, above which a car turns [rad/s]; a change of the lane remains
below.
"""

# [s]
YAW_TIME = 1.0
# Cars in a net at the same time.
TOGETHER = 20
# Time of driving before the track begins [s].
SETTLED = 60.0
# Above the speed of all cars [m/s].
FASTEST = 30.0
NET_SEED = "1"
NET_FLAGS = (
    "--default.lanenumber 2 --junctions.limit-turn-speed 2.5 --junctions.internal-link-detail 20"
)
SUMO_FLAGS = (
    "--lanechange.duration 3 --time-to-teleport -1 --fcd-output.attributes x,y,angle --precision 3"
)
CAR = '<vType id="car" sigma="0.5" speedDev="0.15"/>'


@dataclass(frozen=True)
class RoadNet:
    """A kind of road net.

    Attributes:
        flags: of `netgenerate`, by which it is made.
        speed: median of the cars [m/s].
        radius: median in turns [m].
        lasting: durations of modes: the least one, and the mean of what is exponential beyond it,
            of all modes [s].
        ticks, noises: see `Aircraft`.
    """

    simulator: ClassVar[str] = "SUMO"
    module: ClassVar[str] = "sumo"

    flags: str
    speed: float
    radius: float
    lasting: tuple[float, float]
    ticks: tuple[float, ...] = (0.2, 0.4, 0.8)
    noises: tuple[float, ...] = (0.5, 1.5, 5.0)

    def travel(self, seed: int, duration: float) -> Path:
        """See `Aircraft.travel`."""
        return _drive_together(self, seed // TOGETHER, duration)[seed % TOGETHER]


CARS = {
    "grid": RoadNet(
        "--grid --grid.number 6 --grid.length 150 --default.junctions.radius 12 --default.speed"
        " 13.9",
        12.5,
        17.9,
        (1.0, 8.1),
    ),
    "ring roads": RoadNet(
        "--spider --spider.arm-number 9 --spider.circle-number 5 --spider.space-radius 150"
        " --spider.omit-center --default.junctions.radius 25 --default.speed 16.7",
        16.0,
        39.0,
        (1.0, 6.7),
    ),
    "country": RoadNet(
        "--rand --rand.iterations 100 --rand.min-distance 200 --rand.max-distance 400"
        " --rand.min-angle 45 --default.junctions.radius 40 --default.speed 22.2",
        16.8,
        51.0,
        (1.0, 6.6),
    ),
}


@functools.lru_cache(maxsize=8)
def _drive_together(net: RoadNet, block: int, duration: float) -> list[Path]:
    """Return the paths of `TOGETHER` successive seeds."""
    return [_path(one) for one in _drive(net, block, round(duration / CONTROL))]


def _path(points: NDArray[np.float64]) -> Path:
    """Return the path of positions [m] and of a heading, clockwise from north [deg], (n, 3)."""
    east, north = (np.gradient(one, CONTROL) for one in points.T[:2])
    states = np.stack(
        [
            points[:, 0],
            east,
            points[:, 1],
            north,
        ],
        axis=1,
    )
    rate = -np.gradient(np.unwrap(np.radians(points[:, 2])), CONTROL)
    mean = uniform_filter1d(rate, round(YAW_TIME / CONTROL))
    return Path(states, np.select([mean > TURNING, mean < -TURNING], [1, 2], 0))


def _drive(net: RoadNet, block: int, count: int) -> list[NDArray[np.float64]]:
    """Return positions [m] and heading [deg] (n, 3) of each car, at the last moments.

    Raises:
        ModuleNotFoundError: SUMO is not installed.
    """
    duration = SETTLED + count * CONTROL
    with tempfile.TemporaryDirectory() as name:
        folder = FilePath(name)
        roads, cars, found = (folder / one for one in ("net.xml", "cars.xml", "found.csv"))
        _run("netgenerate", f"{net.flags} {NET_FLAGS} --no-turnarounds --seed {NET_SEED} -o", roads)
        cars.write_text(_routes(ElementTree.parse(roads).getroot(), block, FASTEST * duration))
        flags = f"--step-length {CONTROL} --end {duration} --seed {block} {SUMO_FLAGS}"
        _run(
            "sumo",
            f"{flags} -n",
            roads,
            "-r",
            cars,
            "--fcd-output",
            found,
        )
        # Time, car, x, y, heading; in the order of time.
        rows = np.loadtxt(found, delimiter=";", skiprows=1)
    return [rows[rows[:, 1] == car][-count:, 2:] for car in range(TOGETHER)]


def _run(program: str, flags: str, *further: str | FilePath) -> None:
    # Loaded where it is used: few have it.
    import sumo

    command = [FilePath(sumo.SUMO_HOME) / "bin" / program, *flags.split(), *further]
    subprocess.run(command, check=True, capture_output=True)


def _routes(roads: ElementTree.Element, seed: int, length: float) -> str:
    """Return the demand of SUMO: cars that turn at random at every junction, for at least a
    length [m].
    """
    edges = [one for one in roads.findall("edge") if one.get("function") != "internal"]
    lengths = {str(one.get("id")): float(one[0].get("length", 0.0)) for one in edges}
    following: dict[str, set[str]] = {edge: set() for edge in lengths}
    for one in roads.findall("connection"):
        if one.get("from") in following:
            following[str(one.get("from"))].add(str(one.get("to")))
    # Roads that end.
    while ends := {edge for edge, after in following.items() if not after}:
        following = {edge: after - ends for edge, after in following.items() if edge not in ends}
    generator = np.random.default_rng(seed)
    names = sorted(following)
    lines = []
    for car in range(TOGETHER):
        route = [names[generator.integers(len(names))]]
        while sum(lengths[edge] for edge in route) < length:
            after = sorted(following[route[-1]])
            route.append(after[generator.integers(len(after))])
        start = (
            f'id="{car}" type="car" depart="0" departPos="random" departLane="best"'
            ' departSpeed="max"'
        )
        lines.append(f'<vehicle {start}><route edges="{" ".join(route)}"/></vehicle>')
    return "\n".join(["<routes>", CAR, *lines, "</routes>"])
