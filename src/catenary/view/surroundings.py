"""A simulated arm's base, payload, sensor, friction and wear, and the controls of its page."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.payload import Payload
from catenary.plant import Bounded
from catenary.sensing.imu import SensedGravity
from catenary.sensing.vector import GravityReading, ReadingStatus
from catenary.simulation.base_motion import BaseSamples, SteeredBase
from catenary.simulation.cable_plant import CablePlant, PositioningArm
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.simulation.sensors import InjectedFault
from catenary.units import DISPLAY
from catenary.view.shown import (
    ButtonsControl,
    ChoiceControl,
    Control,
    ControlTab,
    SliderControl,
    ToggleControl,
    Value,
    finite_ranges,
)
from catenary.workflows.gravity.simulated_arm import SimulatedArm, base_sensor

NOISY = 0.5  # [m/s2] standard deviation of an axis of a reading
# of the sensor, by what the page calls them
FAULTS: Mapping[str, str | None] = {
    "none": None, "unplugged": "drop_out", "stuck": "stuck", "noisy": None, "wrong sign": "wrong_sign",
    "spikes": "spikes", "came loose": "jump",
}  # fmt: skip
# what takes the place of a reading that does not come (SensedGravity)
AGED = {
    ReadingStatus.STALE: "no new gravity: the last one is held",
    ReadingStatus.FALLBACK: "no new gravity: its mean direction of the last seconds is taken",
}
# of a robot without cables at "1": times its largest torque, or 1 Nm or N where that is not known
RIGID_FRICTION = 0.02
MOST_FRICTION = 4.0
CHANGED_BY = {"payload_kg": "carry", "friction": "rub", "wear": "wear"}  # method of a robot with cables
GOTO = "goto:"  # begins the name of a joint's slider
MOTIONS = REST, GO_TO, RANDOM, ZIGZAG = "rest", "go to the sliders", "random motion", "zig-zag"
ENABLE, PAUSE, HOME = LEVELS = ("enable", "pause", "home")
OWN = "the robot's own position control"
CONTROLLERS = {
    "PD alone": "pd",
    "PD + gravity of a level base (SG)": "sg",
    "PD + sensed gravity (DG)": "dg",
    "gravity compensation alone": "hold",
    OWN: "own",
}


class PlantBase(NamedTuple):
    """The base that a plant stands on, whichever it is at the time."""

    plant: CablePlant | MujocoPlant

    def sample(self, times: Floats) -> BaseSamples:
        """Return the base's motion at times (N,) [s]."""
        return self.plant.base.sample(times)


class Surroundings:
    """A simulated arm's base, payload, sensor, friction and wear; a GravitySource, by a sensor on its base."""

    def __init__(self, arm: SimulatedArm) -> None:
        """Take an arm on a SteeredBase."""
        plant = arm.plant
        self.plant = cast(CablePlant | MujocoPlant, plant.arm if isinstance(plant, PositioningArm) else plant)
        self.has_cables = isinstance(self.plant, CablePlant)
        self._torque = np.where(np.isfinite(arm.largest_torque), arm.largest_torque, 1.0)
        self._sensor, mounting = base_sensor(PlantBase(self.plant), start=self.plant.time)
        self._quiet = self._sensor.model
        self._sensed = SensedGravity(self._sensor.mailbox, mounting, feed=self._sensor.advance)
        self._attitude = {"roll_deg": 0.0, "pitch_deg": 0.0, "rocking_deg": 0.0, "rocking_hz": 0.5}
        self._base = SteeredBase()
        self.reading: GravityReading | None = None  # the last one

    def set(self, name: str, value: Value) -> bool:
        """Change something by the name of its control; False for an unknown name."""
        plant = self.plant
        if name == "sensor":
            self._break_sensor(str(value))
            return True
        if name in self._attitude:
            self._attitude[name] = float(value)
            *angles, frequency = self._attitude.values()
            roll, pitch, amplitude = np.deg2rad(angles)
            self._base = self._base.toward(plant.time, roll, pitch, amplitude=amplitude, frequency=frequency)
            plant.stand_on(self._base)
        elif name == "payload_kg" and isinstance(plant, MujocoPlant):
            plant.attach(Payload(float(value)) if float(value) > 0.0 else None)
        elif name == "friction" and isinstance(plant, MujocoPlant):
            plant.rub(float(value) * RIGID_FRICTION * self._torque)
        elif isinstance(plant, CablePlant) and name in CHANGED_BY:
            getattr(plant, CHANGED_BY[name])(float(value))
        else:
            return False
        return True

    def read(self, time: float) -> GravityReading:
        """Return gravity as the sensor says at a time [s]."""
        self.reading = self._sensed.read(time)
        return self.reading

    def actual(self) -> Floats:
        """Return gravity as it is (3,) [m/s2], in the base frame."""
        return np.asarray(self._base.sample(np.array([self.plant.time])).gravity[0])

    def warnings(self) -> tuple[str, ...]:
        """Return warnings of the sensor."""
        reading = self.reading
        if reading is None:
            return ()
        said = []
        if reading.status in AGED:
            said.append(AGED[reading.status])
        if reading.faults:
            said.append(f"sensor: {reading.faults.message}")
        return tuple(said)

    def _break_sensor(self, fault: str) -> None:
        kind = FAULTS.get(fault)
        self._sensor.faults = () if kind is None else (InjectedFault(kind, self.plant.time),)
        noise = NOISY / math.sqrt(0.5 * self._quiet.rate_hz)
        self._sensor.model = replace(self._quiet, noise=noise) if fault == "noisy" else self._quiet


def driving_tabs(
    limits: Bounded, q: Floats, *, motion: str, controller: str, has_cables: bool, has_model: bool
) -> tuple[ControlTab, ...]:
    """Return the tabs of an arm at q (n,) [rad|m]: motion and controller, picked as given, surroundings, model."""
    drive = ControlTab(
        "Drive",
        (
            ButtonsControl("level", "run level", LEVELS, hint="Home: against the stops, as a real RAVEN-II does."),
            ChoiceControl("motion", "motion", MOTIONS if has_cables else MOTIONS[:3], motion),
            ChoiceControl("controller", "controller", tuple(CONTROLLERS), controller),
            *joint_sliders(limits, q),
        ),
    )
    world: list[Control] = [
        SliderControl("roll_deg", "base roll [deg]", -90.0, 90.0, 1.0, 0.0, hint="About x."),
        SliderControl("pitch_deg", "base pitch [deg]", -90.0, 90.0, 1.0, 0.0, hint="Then about the base's own y."),
        SliderControl("rocking_deg", "rocking, to either side [deg]", 0.0, 20.0, 0.5, 0.0, hint="About x."),
        SliderControl("rocking_hz", "rocking [Hz]", 0.1, 2.0, 0.1, 0.5),
        SliderControl("payload_kg", "payload [kg]", 0.0, 1.0 if has_cables else 5.0, 0.05, 0.0,
                      hint="The controller does not know of it."),
        ChoiceControl("sensor", "gravity sensor's fault", tuple(FAULTS), "none"),
        SliderControl("friction", "Coulomb friction, x its own" if has_cables else "Coulomb friction",
                      0.0, MOST_FRICTION, 0.1, 1.0 if has_cables else 0.0),
    ]  # fmt: skip
    if has_cables:
        world.append(
            SliderControl("wear", "cable wear [share]", 0.0, 1.0, 0.05, 0.0, hint="Stretch that stays, stiffness lost.")
        )
    tabs = [drive, ControlTab("Surroundings", tuple(world))]
    if has_model:
        text = "The calibrated arm shows where the model says that the joints are. Switched on, the loop goes by it."
        switch = ToggleControl("model", "the loop goes by the model", False)
        tabs.append(ControlTab("Model", (switch,), text))
    return tuple(tabs)


def joint_sliders(limits: Bounded, q: Floats) -> list[Control]:
    """Return a slider for each joint [deg|mm]."""
    found: list[Control] = []
    ranges = finite_ranges(limits)
    for j, (name, unit) in enumerate(zip(limits.joint_names, limits.joint_units, strict=True)):
        shown, scale = DISPLAY[unit]
        # a tenth within the limits, which are whole degrees but for their last digit
        low = float(np.ceil(10.0 * scale * ranges.lower[j] - 1e-6) / 10.0)
        high = float(np.floor(10.0 * scale * ranges.upper[j] + 1e-6) / 10.0)
        value = float(np.clip(round(scale * float(q[j]), 1), low, high))
        found.append(SliderControl(f"{GOTO}{name}", f"{name} [{shown}]", low, high, 0.1, value))
    return found
