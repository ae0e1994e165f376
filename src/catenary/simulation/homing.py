"""How a RAVEN-II finds its joints: each axis runs into its stop, which registers its encoder.

[RAVEN-II source, branch master, homing.cpp] Tools first, the positioning joints standing still; then the three
positioning joints together. An axis has met its stop when the DAC that its PD asks for reaches a threshold.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.errors import NotReadyError
from catenary.simulation.cable_parameters import Rig
from catenary.simulation.firmware import FOUND, GUARDED, PERIOD, POSITION, SEEKING, register

if TYPE_CHECKING:
    from catenary.simulation.cable_plant import CablePlant

# [rad/s, rad/s, m/s, rad/s...] towards the stops: shoulder down, elbow up, insertion out, tools up
SEEK_SPEED = np.array([-np.deg2rad(10.0), np.deg2rad(10.0), 0.02, *np.deg2rad([80.0, 40.0, 40.0, 40.0])])
RAMP = 0.5  # [s] in which the speed rises as v (1 - cos 2 pi t)
AMPLIFIER_WAIT = 1.0  # [s]
REGISTER_WAIT = 0.2  # [s] from the last stop to the registration
HOME_TIME = 2.5  # [s] of the half cosine to the home position
LONGEST_SEEK = 60.0  # [s]
POSITIONING = np.array([True] * 3 + [False] * 4)
TOOLS = ~POSITIONING
WAITED_FOR = np.array([False] * 3 + [True, True, True, False])  # the last jaw is not waited for


def home(plant: "CablePlant") -> Iterator[Floats]:
    """Home an arm, tick by tick: each item is the next row of setpoints (7,).

    Raises:
        NotReadyError: An axis met no stop in a minute.
    """
    firmware, control = plant.firmware, plant.control
    control.flags[GUARDED] = 0  # the stops lie beyond the software limits
    control.mode[:] = POSITION
    control.integral[:] = 0.0
    hold = control.joint.copy()
    for _ in range(round(AMPLIFIER_WAIT / PERIOD)):
        yield hold
    yield from _seek(plant, TOOLS, WAITED_FOR)
    registered = np.where(TOOLS, firmware.stop_value, firmware.home_value)
    register(firmware, control, registered, np.ones(7, dtype=bool))
    yield from _move(control.joint.copy(), np.where(TOOLS, firmware.home_value, control.joint))
    plant.rig_peak_begin()
    yield from _seek(plant, POSITIONING, POSITIONING)
    plant.rig_register()
    registered = np.where(POSITIONING, firmware.stop_value, control.joint)
    register(firmware, control, registered, np.ones(7, dtype=bool))
    yield from _move(control.joint.copy(), np.where(POSITIONING, firmware.home_value, control.joint))
    control.flags[GUARDED] = 1


def _seek(plant: "CablePlant", axes: np.ndarray, waited_for: np.ndarray) -> Iterator[Floats]:
    """Run axes towards their stops until those waited for have met them, and a moment longer."""
    control = plant.control
    wanted = control.joint.copy()
    control.seek[axes] = SEEKING
    t, since = 0.0, 0.0
    while since < REGISTER_WAIT:
        ramp = 1.0 - np.cos(2.0 * np.pi * t) if t < RAMP else 1.0
        found = control.seek == FOUND
        moving = axes & ~found
        wanted = np.where(
            moving, wanted + SEEK_SPEED * ramp * PERIOD, np.where(found, control.setpoint, wanted)
        )
        yield wanted
        t += PERIOD
        if (found | ~waited_for).all():
            since += PERIOD
        if t > LONGEST_SEEK:
            lost = [
                name for name, f, w in zip(plant.joint_names, found, waited_for, strict=True) if w and not f
            ]
            raise NotReadyError(f"homing: {', '.join(lost)} met no stop in {LONGEST_SEEK:g} s")
    control.seek[:] = 0


def _move(start: Floats, goal: Floats) -> Iterator[Floats]:
    """Go from start to goal along half a cosine."""
    ticks = round(HOME_TIME / PERIOD)
    for k in range(1, ticks + 1):
        yield start + (goal - start) * 0.5 * (1.0 - np.cos(np.pi * k / ticks))


def registered_zero(rig: Rig, counts: Floats, sides: Floats) -> Floats:
    """Counts (3,) that the rig takes for its stops: the mean of those within a window of the peak.

    Args:
        rig: The external encoders.
        counts: (T, 3) seen while the joints ran into their stops.
        sides: (3,) -1 for a stop below, 1 above.
    """
    peak = np.max(counts * sides, axis=0) * sides
    near = np.abs(counts - peak) <= rig.window
    zero: Floats = np.where(near, counts, 0.0).sum(axis=0) / near.sum(axis=0)
    return zero
