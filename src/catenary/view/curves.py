"""Curves over the last half minute: errors of a joint, its torque in parts, rates and ages."""

from collections import deque
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Jointed
from catenary.units import DISPLAY, TORQUE_UNIT
from catenary.view.state import ViewState

SPAN = 30.0  # [s]
SPACING = 0.1  # [s] between two of their points


class Curve(NamedTuple):
    """A line of a plot."""

    label: str  # empty for one that another's label names too
    values: Floats  # (K,) NaN where it is not known
    colour: str
    dashed: bool = False


class Plot(NamedTuple):
    """Curves over one time axis."""

    title: str
    time: Floats  # (K,) [s] from now: before it negative
    curves: tuple[Curve, ...]

    def known(self) -> tuple[Curve, ...]:
        """Return the curves with known values; unknown values repeat the last known one, as no gap can be drawn."""
        return tuple(
            curve._replace(values=_level(curve.values)) for curve in self.curves if np.isfinite(curve.values).any()
        )


def _level(values: Floats) -> Floats:
    """Return values (K,) with those that are not finite replaced by the last one before, or the first one after."""
    finite = np.isfinite(values)
    places = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
    return values[np.where(places < 0, int(np.argmax(finite)), places)]


REPORTED, CALIBRATED, TRUE, GRAVITY, PD, REST = ("#4b6b94", "#1f9d55", "#e07b00", "#7a4fbf", "#c0392b", "#8a8f98")


class JointColumns(NamedTuple):
    """States one after the other, as arrays (K, n) [SI]; NaN where something is not known."""

    time: Floats  # (K,) [s]
    q: Floats
    calibrated: Floats
    interval: Floats
    true: Floats
    setpoint: Floats
    tau: Floats
    gravity_tau: Floats
    feedback: Floats


class Curves:
    """What is drawn of the last half minute of states, or of the part of a recording around the present one."""

    def __init__(self, joints: Jointed, recording: JointColumns | None = None) -> None:
        """Begin without any state."""
        self._names, self._units, self._recording = joints.joint_names, joints.joint_units, recording
        self.span = (-SPAN, 0.0) if recording is None else (-0.5 * SPAN, 0.5 * SPAN)  # [s] from now that is drawn
        self._states: deque[ViewState] = deque(maxlen=round(SPAN / SPACING))
        self._now = 0.0

    def add(self, state: ViewState) -> None:
        """Take a state; those too close to the last are left out, and time that goes back restarts them."""
        self._now = state.time
        if self._states and state.time < self._states[-1].time:
            self._states.clear()
        if not self._states or state.time - self._states[-1].time >= SPACING - 1e-9:
            self._states.append(state)

    def plots(self, joint: int) -> tuple[Plot, ...]:
        """Return the plots of a joint: errors [deg|mm], torque [Nm|N] and, of a robot that runs, the loop."""
        name, unit = self._names[joint], self._units[joint]
        if self._recording is not None:
            near = np.abs(self._recording.time - self._now) <= 0.5 * SPAN
            part = JointColumns(*(column[near] for column in self._recording))
            return joint_plots(part._replace(time=part.time - self._now), joint, name, unit)

        def of(name: str) -> Floats:
            return np.array([getattr(state, name) for state in self._states], dtype=float)

        columns = JointColumns(*(of(name) for name in JointColumns._fields))
        if self._states:
            columns = columns._replace(time=columns.time - self._states[-1].time)
        loop = (
            Curve("rate %", 100.0 * of("rate"), REPORTED),
            Curve("late ticks/s", of("late"), PD),
            Curve("gravity age ms", 1e3 * of("gravity_age"), GRAVITY),
        )
        return (*joint_plots(columns, joint, name, unit), Plot("loop", columns.time, loop))


def joint_plots(columns: JointColumns, joint: int, name: str, unit: str) -> tuple[Plot, Plot]:
    """Return the plots of a joint: errors [deg|mm] and torque [Nm|N] in parts."""
    shown, scale = DISPLAY[unit]
    if len(columns.time) == 0:
        return Plot(f"{name}: error [{shown}]", columns.time, ()), Plot(f"{name}: torque", columns.time, ())
    c = JointColumns(columns.time, *(column[:, joint] for column in columns[1:]))
    errors = (
        Curve("reported", scale * (c.q - c.true), REPORTED),
        Curve("calibrated", scale * (c.calibrated - c.true), CALIBRATED),
        Curve("interval \u00b1", scale * c.interval, CALIBRATED, True),
        Curve("", -scale * c.interval, CALIBRATED, True),
        Curve("tracking", scale * (c.q - c.setpoint), REST),
    )
    torques = (
        Curve("total", c.tau, REPORTED),
        Curve("gravity", c.gravity_tau, GRAVITY),
        Curve("PD", c.feedback, PD),
        Curve("friction, inertia", c.tau - c.gravity_tau, REST, True),
    )
    return (
        Plot(f"{name}: error [{shown}]", c.time, errors),
        Plot(f"{name}: torque [{TORQUE_UNIT[unit]}]", c.time, torques),
    )
