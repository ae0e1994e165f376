"""Homing of the simulated RAVEN-II: each axis runs into its stop, which registers its encoders, own and external ones.

[RAVEN-II source, branch master, homing.cpp] Tools first, the positioning joints standing still; then the three
positioning joints together. An axis has met its stop when the DAC that its PD asks for reaches a threshold.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import NotReadyError
from catenary.simulation.cable_parameters import Firmware, Rig
from catenary.simulation.cable_physics import ArmState
from catenary.simulation.firmware import FOUND, SEEKING, ControlState, register
from catenary.simulation.firmware_plant import half_cosine
from catenary.simulation.records import OFF, POSITION
from catenary.simulation.simulated_plant import PERIOD

# [rad/s, rad/s, m/s, rad/s...] towards the stops: shoulder down, elbow up, insertion out, tools up
_SEEK_SPEEDS = np.array([-np.deg2rad(10.0), np.deg2rad(10.0), 0.02, *np.deg2rad([80.0, 40.0, 40.0, 40.0])])
_RAMP_S = 0.5  # [s] in which the speed rises as v (1 - cos 2 pi t)
_AMPLIFIER_WAIT_S = 1.0  # [s]
_REGISTER_WAIT_S = 0.2  # [s] from the last stop to the registration
_HOME_TIME_S = 2.5  # [s] of the half cosine to the home position
_MAX_SEEK_S = 60.0  # [s]
_POSITIONING_AXES = np.array([True] * 3 + [False] * 4)
_TOOL_AXES = ~_POSITIONING_AXES
Booleans = NDArray[np.bool_]
_AWAITED_AXES = np.array([False] * 3 + [True, True, True, False])  # the last jaw is not waited for


class ExternalEncoders:
    """Encoders that see the joints themselves, beyond the cables."""

    def __init__(self, rig: Rig) -> None:
        """Take the rig's numbers; the encoders are not registered."""
        self.rig = rig
        self.zero = np.full(3, np.nan)  # (3,) counts at which a joint is where `rig.registered` says

    def counts(self, q: Floats) -> Floats:
        """Return the counts at true joint positions (..., 3) [rad, rad, m]."""
        return np.round(q * self.rig.counts)

    def positions(self, counts: Floats) -> Floats:
        """Return the joint positions that the rig reports, (..., 3) [rad, rad, m]; NaN before it is registered."""
        return np.asarray(self.rig.registered + (counts - self.zero) / self.rig.counts)


def mean_near_peak(counts: Floats, side: Floats, window: Floats) -> Floats:
    """Return the mean (3,) of the counts (T, 3) within a window (3,) of their peaks on the given sides (3,)."""
    peak = np.max(counts * side, axis=0) * side
    near = np.abs(counts - peak) <= window
    return np.asarray(np.where(near, counts, 0.0).sum(axis=0) / near.sum(axis=0))


def home(
    firmware: Firmware, control: ControlState, arm: ArmState, encoders: ExternalEncoders, stop_side: Floats,
    joint_names: Sequence[str],
) -> Iterator[Floats]:  # fmt: skip
    """Home an arm, tick by tick: each item is the next row of setpoints (7,); the rest is written to control.

    The rig's encoders are registered at the stops of the positioning joints, on stop_side (3,), -1 for one below: at
    the mean of the counts near their peak.
    """
    control.guarded = False  # the stops lie beyond the software limits
    control.mode[:] = POSITION
    hold = control.joint.copy()
    for _ in range(round(_AMPLIFIER_WAIT_S / PERIOD)):
        yield hold
    yield from _seek(control, _TOOL_AXES, _AWAITED_AXES, joint_names)
    register(firmware, control, np.where(_TOOL_AXES, firmware.stop_value, firmware.home_value))
    yield from half_cosine(control.joint.copy(), np.where(_TOOL_AXES, firmware.home_value, control.joint), _HOME_TIME_S)
    seen = []
    for wanted in _seek(control, _POSITIONING_AXES, _POSITIONING_AXES, joint_names):
        yield wanted
        seen.append(encoders.counts(arm.q))
    encoders.zero = mean_near_peak(np.array(seen), stop_side, encoders.rig.window)
    register(firmware, control, np.where(_POSITIONING_AXES, firmware.stop_value, control.joint))
    yield from half_cosine(
        control.joint.copy(), np.where(_POSITIONING_AXES, firmware.home_value, control.joint), _HOME_TIME_S
    )


def _seek(control: ControlState, axes: Booleans, waited_for: Booleans, joint_names: Sequence[str]) -> Iterator[Floats]:
    """Run axes towards their stops until those waited for have met them, and a moment longer."""
    wanted, seek, setpoint = control.joint.copy(), control.seek, control.setpoint
    seek[axes] = SEEKING
    t, since = 0.0, 0.0
    while since < _REGISTER_WAIT_S:
        ramp = 1.0 - np.cos(2.0 * np.pi * t) if t < _RAMP_S else 1.0
        found = seek == FOUND
        moving = axes & ~found
        wanted = np.where(moving, wanted + _SEEK_SPEEDS * ramp * PERIOD, np.where(found, setpoint, wanted))
        yield wanted
        t += PERIOD
        if (found | ~waited_for).all():
            since += PERIOD
        if t > _MAX_SEEK_S:
            lost = [joint_names[int(j)] for j in np.flatnonzero(waited_for & ~found)]
            raise NotReadyError(f"homing: {', '.join(lost)} met no stop in {_MAX_SEEK_S:g} s")
    seek[:] = OFF
