"""Aircraft of the flight dynamics model JSBSim, which a commanded bank flies through turns.

Berndt 2004, "JSBSim: an open source flight dynamics model in C++", AIAA 2004-4923. Unlike the
object of the environments, an aircraft needs seconds to roll into a turn and out of it, its speed
and height change in turns, and its banks differ from the nominal one, so its radii do. No rudder is
used; the model of the fighter slips in turns even with full rudder. JSBSim is a module of its own,
with the aircraft in it.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.simulators.paths import CONTROL, Path, flown_path

# [m/s^2]
GRAVITY = 9.81
# [m]
FOOT = 0.3048
# Of the flight dynamics [s].
STEP = 1.0 / 60.0
# Of them between two corrections of the controls.
STEPS = round(CONTROL / STEP)
# Time of straight flight before the track begins [s].
SETTLED = 20.0
# A commanded bank differs from the nominal one by up to this share.
BANK_SPREAD = 0.15
# Aileron by the error of the bank [1/deg], its rate and its integral.
BANK_GAINS = 0.02, 0.015, 0.004
# Error of the bank below which it is integrated [deg].
NEAR = 8.0
# Elevator by the error of the path angle [1/deg], its integral, pitch rate.
CLIMB_GAINS = 0.05, 0.02, 0.5
# [1/s], [ft/s].
HEIGHT_GAIN, LARGEST_CLIMB = 0.1, 20.0
# [1/knot]
THROTTLE_GAIN = 0.03
# Of the integrals of aileron and elevator.
LARGEST_TRIM = 0.3, 0.5
# At most.
ENGINES = 4


@dataclass(frozen=True)
class Aircraft:
    """An aircraft of JSBSim and how it is flown.

    Attributes:
        name: of its model in JSBSim.
        height: [ft].
        airspeed: calibrated [knots].
        speed: true, which follows from both [m/s].
        bank: nominal bank of turns [deg].
        turning: rate at which it turns with this bank, as a share of the rate without slip.
        ticks: lengths of a tick [s].
        noises: standard deviations of a measured position [m].
    """

    simulator: ClassVar[str] = "JSBSim"
    module: ClassVar[str] = "jsbsim"

    name: str
    height: float
    airspeed: float
    speed: float
    bank: float
    turning: float
    ticks: tuple[float, ...]
    noises: tuple[float, ...]

    @property
    def radius(self) -> float:
        """Radius of a turn with the nominal bank: without slip v^2 / (g tan bank) [m]."""
        return self.speed**2 / (GRAVITY * math.tan(math.radians(self.bank))) / self.turning

    @property
    def lasting(self) -> tuple[float, float]:
        """Durations of modes [s]: the least one, of a turn by a radian, and the mean of what is
        exponential beyond.
        """
        return self.radius / self.speed, 2.0 * self.radius / self.speed

    def travel(self, seed: int, duration: float) -> Path:
        """Return the path of a duration [s], with modes and banks drawn by a seed."""
        generator = np.random.default_rng(seed)
        count = round(duration / CONTROL)
        modes, commands = draw_commands(self, count, generator)
        heading = generator.uniform(0.0, 360.0)
        flown = _fly(self, heading, np.append(np.zeros(round(SETTLED / CONTROL)), commands))
        return flown_path(flown[-count:], modes)


AIRCRAFT = {
    "light": Aircraft("c172x", 3000.0, 95.0, 51.0, 20.0, 1.0, (0.3, 0.6, 1.2), (5.0, 20.0, 80.0)),
    "airliner": Aircraft(
        "737",
        20000.0,
        280.0,
        192.5,
        25.0,
        0.95,
        (0.8, 1.6, 3.2),
        (20.0, 100.0, 500.0),
    ),
    "fighter": Aircraft(
        "f16",
        15000.0,
        350.0,
        221.6,
        45.0,
        0.73,
        (0.5, 1.0, 2.0),
        (20.0, 80.0, 320.0),
    ),
}


def draw_commands(
    craft: Aircraft,
    count: int,
    generator: np.random.Generator,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the modes (count,) at every correction and the commanded banks (count,) [deg],
    right positive.

    A mode lasts as `Aircraft.lasting` says; the next one is one of the other two.
    """
    modes = np.zeros(count, np.int64)
    banks = np.zeros(count)
    first = 0
    mode = int(generator.integers(3))
    while first < count:
        length = math.ceil(
            (craft.lasting[0] + craft.lasting[1] * generator.exponential()) / CONTROL
        )
        bank = craft.bank * generator.uniform(1.0 - BANK_SPREAD, 1.0 + BANK_SPREAD)
        modes[first : first + length] = mode
        banks[first : first + length] = (0.0, -bank, bank)[mode]
        first, mode = first + length, (mode + int(generator.integers(1, 3))) % 3
    return modes, banks


def _fly(craft: Aircraft, heading: float, commands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return velocity east and north [m/s] after every correction of the controls, (n, 2)."""
    # Loaded where it is used: few have it.
    import jsbsim

    # Of this thread: the base class prints nothing.
    jsbsim.set_logger(jsbsim.FGLogger())
    model = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    model.load_model(craft.name)
    model.set_dt(STEP)
    for name, value in (
        ("h-sl-ft", craft.height),
        ("vc-kts", craft.airspeed),
        ("psi-true-deg", heading),
    ):
        model[f"ic/{name}"] = value
    model.run_ic()
    model["propulsion/set-running"] = -1
    model["simulation/do_simple_trim"] = 1
    # None where there is none.
    node: Any = model.get_property_manager().get_node

    def read(name: str) -> Any:
        return node(name).get_double_value

    bank, roll, pitch = (
        read(name) for name in ("attitude/phi-deg", "velocities/p-rad_sec", "velocities/q-rad_sec")
    )
    height = read("position/h-sl-ft")
    climb = read("velocities/h-dot-fps")
    speed = read("velocities/vt-fps")
    knots = read("velocities/vc-kts")
    east = read("velocities/v-east-fps")
    north = read("velocities/v-north-fps")
    aileron, elevator = (node(f"fcs/{name}-cmd-norm") for name in ("aileron", "elevator"))
    throttles = [
        one for k in range(ENGINES) if (one := node(f"fcs/throttle-cmd-norm[{k}]")) is not None
    ]
    trimmed = elevator.get_double_value()
    power = throttles[0].get_double_value()
    level = height()
    # Integrals.
    side = 0.0
    up = 0.0
    found = np.empty((len(commands), 2))
    for k, command in enumerate(commands.tolist()):
        error = command - bank()
        if abs(error) < NEAR:
            side = _clip(side + BANK_GAINS[2] * error * CONTROL, LARGEST_TRIM[0])
        aileron.set_double_value(
            _clip(BANK_GAINS[0] * error - BANK_GAINS[1] * math.degrees(roll()) + side, 1.0)
        )
        wanted = _clip(HEIGHT_GAIN * (level - height()), LARGEST_CLIMB)
        angle = math.degrees((wanted - climb()) / speed())
        up = _clip(up + CLIMB_GAINS[1] * angle * CONTROL, LARGEST_TRIM[1])
        elevator.set_double_value(
            _clip(trimmed - CLIMB_GAINS[0] * angle - up + CLIMB_GAINS[2] * pitch(), 1.0)
        )
        thrust = min(max(power + THROTTLE_GAIN * (craft.airspeed - knots()), 0.0), 1.0)
        for throttle in throttles:
            throttle.set_double_value(thrust)
        for _ in range(STEPS):
            model.run()
        found[k] = FOOT * east(), FOOT * north()
    return found


def _clip(value: float, largest: float) -> float:
    return min(max(value, -largest), largest)
