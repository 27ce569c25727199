"""Aircraft of the flight dynamics model JSBSim, which a commanded bank flies through turns.

Berndt 2004, "JSBSim: an open source flight dynamics model in C++", AIAA 2004-4923. Unlike the
object of the environments, an aircraft needs seconds to roll into a turn and out of it, its speed
and height change in turns, and its banks differ from the nominal one, so its radii do. No rudder is
used; the model of the fighter slips in turns even with full rudder. JSBSim is a module of its own,
with the aircraft in it.
"""

import math
from dataclasses import dataclass

import numpy as np

from studies.simulators.vehicles import CONTROL, FloatArray, IntArray, Path, Vehicle, flown_path

# [m]
FOOT = 0.3048
# Corrections of the controls in straight flight before the track begins.
SETTLED = 200


@dataclass(frozen=True, kw_only=True)
class Aircraft(Vehicle):
    """An aircraft of JSBSim and how it is flown; see `Vehicle`.

    Attributes:
        name: of its model in JSBSim.
        height: [ft].
        airspeed: calibrated [knots].
        speed: true, which follows from both [m/s].
        bank: nominal bank of turns [deg].
        turning: rate at which it turns with this bank, as a share of the rate without slip.
    """

    simulator = "JSBSim"
    block_size = 1

    name: str
    height: float
    airspeed: float
    speed: float
    bank: float
    turning: float = 1.0
    ticks: tuple[float, ...]
    noises: tuple[float, ...]

    @property
    def radius(self) -> float:  # type: ignore[override]
        """Radius of a turn with the nominal bank: without slip v^2 / (g tan bank) [m]."""
        return self.speed**2 / (9.81 * math.tan(math.radians(self.bank))) / self.turning

    @property
    def lasting(self) -> tuple[float, float]:  # type: ignore[override]
        """Durations of modes [s]: the least one is that of a turn by a radian."""
        return self.radius / self.speed, 2.0 * self.radius / self.speed

    def paths(self, block: int, duration: float) -> list[Path]:
        """See `Vehicle.paths`."""
        generator = np.random.default_rng(block)
        modes, banks = self.commands(round(duration / CONTROL), generator)
        velocities = self._fly(generator.uniform(0.0, 360.0), banks)
        return [flown_path(velocities[SETTLED:], modes)]

    def commands(
        self, count: int, generator: np.random.Generator, spread: float = 0.15
    ) -> tuple[IntArray, FloatArray]:
        """Return the modes (count,) at every correction, and the commanded banks [deg], right
        positive, with those of straight flight before.

        A mode lasts as `lasting` says; the next one is one of the other two. A bank differs from
        the nominal one by up to the share `spread`.
        """
        modes = np.zeros(count, np.int64)
        banks = np.zeros(SETTLED + count)
        first = 0
        mode = int(generator.integers(3))
        while first < count:
            lasting = self.lasting[0] + self.lasting[1] * generator.exponential()
            end = first + math.ceil(lasting / CONTROL)
            bank = self.bank * generator.uniform(1.0 - spread, 1.0 + spread)
            modes[first:end] = mode
            banks[SETTLED + first : SETTLED + end] = (0.0, -bank, bank)[mode]
            first, mode = end, (mode + int(generator.integers(1, 3))) % 3
        return modes, banks

    def _fly(self, heading: float, banks: FloatArray) -> FloatArray:
        """Return velocity east and north [m/s] after every correction of the controls, (n, 2)."""
        # Loaded where it is used: few have it.
        import jsbsim

        # Of this thread: the base class prints nothing.
        jsbsim.set_logger(jsbsim.FGLogger())
        model = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
        model.load_model(self.name)
        model.set_dt(1.0 / 60.0)
        model["ic/h-sl-ft"] = self.height
        model["ic/vc-kts"] = self.airspeed
        model["ic/psi-true-deg"] = heading
        model.run_ic()
        model["propulsion/set-running"] = -1
        model["simulation/do_simple_trim"] = 1
        trimmed = model["fcs/elevator-cmd-norm"]
        power = model["fcs/throttle-cmd-norm[0]"]
        level = model["position/h-sl-ft"]
        # Integrals of the errors of bank and path angle.
        side = 0.0
        up = 0.0
        velocities = np.empty((len(banks), 2))
        for k, bank in enumerate(banks.tolist()):
            # The aileron by the error of the bank [deg], its integral near to it, the roll rate.
            error = bank - model["attitude/phi-deg"]
            if abs(error) < 8.0:
                side = _clip(side + 0.004 * error * CONTROL, 0.3)
            rolling = math.degrees(model["velocities/p-rad_sec"])
            model["fcs/aileron-cmd-norm"] = _clip(0.02 * error - 0.015 * rolling + side, 1.0)
            # The elevator by the error of the path angle [deg], its integral, the pitch rate. The
            # climb [ft/s] leads back to the height.
            climb = _clip(0.1 * (level - model["position/h-sl-ft"]), 20.0)
            angle = math.degrees(
                (climb - model["velocities/h-dot-fps"]) / model["velocities/vt-fps"]
            )
            up = _clip(up + 0.02 * angle * CONTROL, 0.5)
            pitching = 0.5 * model["velocities/q-rad_sec"]
            model["fcs/elevator-cmd-norm"] = _clip(trimmed - 0.05 * angle - up + pitching, 1.0)
            # The throttle by the error of the speed [knots].
            thrust = power + 0.03 * (self.airspeed - model["velocities/vc-kts"])
            for engine in range(model.get_propulsion().get_num_engines()):
                model[f"fcs/throttle-cmd-norm[{engine}]"] = min(max(thrust, 0.0), 1.0)
            for _ in range(round(CONTROL * 60.0)):
                model.run()
            velocities[k] = model["velocities/v-east-fps"], model["velocities/v-north-fps"]
        return FOOT * velocities


def _clip(value: float, largest: float) -> float:
    return min(max(value, -largest), largest)
