"""Cars of the traffic simulator SUMO on road nets that it generates.

Lopez et al. 2018, "Microscopic traffic simulation using SUMO", ITSC. Twenty cars drive at random
through a net, each with its own wish of speed, in each other's way: they change lanes, brake for
corners and for others who have the right of way, and stop. The mode is the yaw rate: a car turns
while it exceeds `TURNING`. SUMO is a program of its own.
"""

import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from scipy.ndimage import uniform_filter1d

from studies.simulators.vehicles import CONTROL, FloatArray, Path, Vehicle

TURNING = 0.1
"""Yaw rate, as mean of a second, above which a car turns [rad/s]; a change of the lane remains
below.
"""


@dataclass(frozen=True, kw_only=True)
class RoadNet(Vehicle):
    """A kind of road net; see `Vehicle`.

    Attributes:
        flags: of `netgenerate`, by which it is made.
    """

    simulator = "SUMO"

    flags: str
    speed: float
    radius: float
    lasting: tuple[float, float]
    ticks: tuple[float, ...] = (0.2, 0.4, 0.8)
    noises: tuple[float, ...] = (0.5, 1.5, 5.0)

    def paths(self, block: int, duration: float) -> list[Path]:
        """See `Vehicle.paths`."""
        paths = []
        for points in self.drive(block, round(duration / CONTROL)):
            velocities = np.gradient(points[:, :2], CONTROL, axis=0)
            states = np.stack([points[:, :2], velocities], axis=2).reshape(-1, 4)
            rate = -np.gradient(np.unwrap(np.radians(points[:, 2])), CONTROL)
            mean = uniform_filter1d(rate, round(1.0 / CONTROL))
            modes = np.select([mean > TURNING, mean < -TURNING], [1, 2], 0)
            paths.append(Path(states, modes))
        return paths

    def drive(self, block: int, count: int, settled: float = 60.0) -> list[FloatArray]:
        """Return positions [m] and headings, clockwise from north [deg], (n, 3) of each car, at
        the last moments; the cars have driven for a time before [s].

        Raises:
            ModuleNotFoundError: SUMO is not installed.
        """
        duration = settled + count * CONTROL
        with tempfile.TemporaryDirectory() as name:
            folder = FilePath(name)
            roads = folder / "net.xml"
            _run(
                f"netgenerate {self.flags} --default.lanenumber 2 --no-turnarounds --seed 1"
                " --junctions.limit-turn-speed 2.5 --junctions.internal-link-detail 20 -o net.xml",
                folder,
            )
            # Long enough for a car at 30 m/s, above the speed of all.
            routes = self.routes(ElementTree.parse(roads).getroot(), block, 30.0 * duration)
            (folder / "cars.xml").write_text(routes)
            _run(
                f"sumo --step-length {CONTROL} --end {duration} --seed {block} --precision 3"
                " --lanechange.duration 3 --time-to-teleport -1 -n net.xml -r cars.xml"
                " --fcd-output.attributes x,y,angle --fcd-output points.csv",
                folder,
            )
            # Time, car, x, y, heading; in the order of time.
            rows = np.loadtxt(folder / "points.csv", delimiter=";", skiprows=1)
        return [rows[rows[:, 1] == car][-count:, 2:] for car in range(self.block_size)]

    def routes(self, roads: ElementTree.Element, seed: int, length: float) -> str:
        """Return the demand of SUMO: cars that turn at random at every junction, for at least a
        length [m].
        """
        lengths = {
            edge.attrib["id"]: float(edge[0].attrib["length"])
            for edge in roads.findall("edge")
            if edge.get("function") != "internal"
        }
        following: dict[str, set[str]] = {edge: set() for edge in lengths}
        for connection in roads.findall("connection"):
            if connection.attrib["from"] in following:
                following[connection.attrib["from"]].add(connection.attrib["to"])
        # Roads that end.
        while ends := {edge for edge, after in following.items() if not after}:
            following = {edge: after - ends for edge, after in following.items() if after}
        generator = np.random.default_rng(seed)
        lines = ['<routes><vType id="car" sigma="0.5" speedDev="0.15"/>']
        for car in range(self.block_size):
            after = set(following)
            route: list[str] = []
            driven = 0.0
            while driven < length:
                route.append(sorted(after)[generator.integers(len(after))])
                driven += lengths[route[-1]]
                after = following[route[-1]]
            lines.append(
                f'<vehicle id="{car}" type="car" depart="0" departPos="random" departLane="best"'
                f' departSpeed="max"><route edges="{" ".join(route)}"/></vehicle>'
            )
        return "\n".join([*lines, "</routes>"])


def _run(command: str, folder: FilePath) -> None:
    # Loaded where it is used: few have it.
    import sumo

    program, *flags = command.split()
    path = FilePath(sumo.SUMO_HOME) / "bin" / program
    subprocess.run([path, *flags], cwd=folder, check=True, capture_output=True)
