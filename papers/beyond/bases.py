"""A robot homed on a level base that is tilted or rocked afterwards, and gravity as an input of calibration models."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np

from catenary import CablePlant, FixedBase, MotionLog, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.simulation.base_motion import BaseSamples, MovingBase, imu_reading
from papers.calibration.recordings import START
from papers.gravity.raven_base import rocking_base, turned_base

LEVEL_BASE = "level"
ROCKING = "rocking 10-20°"
# turned about Z0, joint 1's axis, or across it, about the base's x
BASES: Mapping[str, MovingBase] = {
    LEVEL_BASE: FixedBase(),
    "20° about Z0": turned_base(20.0),
    "20° across": FixedBase(float(np.deg2rad(20.0))),
    "-20° across": FixedBase(float(np.deg2rad(-20.0))),
    ROCKING: rocking_base(),
}
AXES = ("shoulder", "elbow", "insertion")
GRAVITY = tuple(f"gravity:{axis}" for axis in AXES)  # the model's torque at q_nominal [Nm, Nm, N]
DIFFERENCE = tuple(f"beyond gravity:{axis}" for axis in AXES)  # the robot's torque less that
SETTLING = 2.0  # [s] on a base that was set, longer than the simulation looks ahead


@dataclass
class SetBase:
    """A base that somebody sets: what stands in `now` holds within a second."""

    now: MovingBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return the motion at times (N,) [s], one row for each."""
        gravity, motion = self.now.sample(times)
        rows = len(times)
        return BaseSamples(np.broadcast_to(gravity, (rows, 3)).copy(), np.broadcast_to(motion, (rows, 3, 3)).copy())


def homed_level(seed: int | None, *, substeps: int = 1) -> tuple[CablePlant, SetBase]:
    """Return a robot homed on a level base, and its base."""
    base = SetBase()
    plant = CablePlant(seed=seed, start=START, base=base, substeps=substeps)
    plant.home()
    return plant, base


def put_on(robot: tuple[CablePlant, SetBase], set_to: MovingBase) -> CablePlant:
    """Return a copy of a robot that stands on another base, at rest and not homed anew."""
    plant, base = deepcopy(robot)
    base.now = set_to
    plant.run(np.full((round(SETTLING / plant.period), len(plant.joint_names)), np.nan))
    return plant


def with_gravity(log: MotionLog, base: MovingBase, start: float) -> MotionLog:
    """Return a recording, begun at `start` [s] since power-on, with the gravity model's GRAVITY and DIFFERENCE."""
    if log.time is None or log.tau is None:
        raise InputError(f'recording "{log.name}": has no time or no torques')
    samples = base.sample(start + log.time)
    sensed: Floats = -imu_reading(samples)[0]
    torque = gravity_torque(load_robot("raven2"), log.q_nominal, np.broadcast_to(sensed, (len(log), 3)).copy())
    signals = dict(zip((*GRAVITY, *DIFFERENCE), (*torque.T, *(log.tau - torque).T), strict=True))
    units = dict.fromkeys(signals, "Nm") | dict.fromkeys((GRAVITY[2], DIFFERENCE[2]), "N")
    return replace(log, signals={**log.signals, **signals}, signal_units={**log.signal_units, **units})
