"""Curves over the last half minute: errors of a joint, its torque in parts, rates and ages."""

from collections import deque
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.units import DISPLAY, TORQUE_UNIT
from catenary.view.state import ViewState

SPAN = 30.0  # [s]
SPACING = 0.1  # [s] between two of their points


class Curve(NamedTuple):
    """A line of a plot."""

    label: str
    values: Floats  # (K,) NaN where it is not known
    colour: str
    dashed: bool = False


class Plot(NamedTuple):
    """Curves over one time axis."""

    title: str
    time: Floats  # (K,) [s] from now: before it negative
    curves: tuple[Curve, ...]

    def known(self) -> tuple[Curve, ...]:
        """Return the curves of which something is known; where it is not they go on level, for no gap can be drawn."""
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
    """States of the last half minute, and what is drawn of them."""

    span = (-SPAN, 0.0)  # [s] from now that is drawn

    def __init__(self, joint_names: tuple[str, ...], joint_units: tuple[str, ...]) -> None:
        """Begin without any state."""
        self.joint_names, self._units = joint_names, joint_units
        self._states: deque[ViewState] = deque(maxlen=round(SPAN / SPACING))

    def add(self, state: ViewState) -> None:
        """Take a state; those that follow one another too closely are left out, and time that goes back begins anew."""
        if self._states and state.time < self._states[-1].time:
            self._states.clear()
        if not self._states or state.time - self._states[-1].time >= SPACING - 1e-9:
            self._states.append(state)

    def plots(self, joint: int) -> tuple[Plot, ...]:
        """Return the plots of a joint: errors [deg|mm], torque [Nm|N], the loop."""

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
        plots = joint_plots(columns, joint, self.joint_names[joint], self._units[joint])
        return (*plots, Plot("loop", columns.time, loop))


class RecordedCurves:
    """A whole recording, of which the part about the present state is drawn, with that in the middle."""

    span = (-0.5 * SPAN, 0.5 * SPAN)  # [s] from now that is drawn

    def __init__(self, joint_names: tuple[str, ...], joint_units: tuple[str, ...], columns: JointColumns) -> None:
        """Take a recording."""
        self.joint_names, self._units, self._columns = joint_names, joint_units, columns
        self._now = float(columns.time[0])

    def add(self, state: ViewState) -> None:
        """Take the present state."""
        self._now = state.time

    def plots(self, joint: int) -> tuple[Plot, ...]:
        """Return the plots of a joint: errors [deg|mm] and torque [Nm|N]."""
        near = np.abs(self._columns.time - self._now) <= 0.5 * SPAN
        part = JointColumns(*(column[near] for column in self._columns))
        part = part._replace(time=part.time - self._now)
        return joint_plots(part, joint, self.joint_names[joint], self._units[joint])


def joint_plots(columns: JointColumns, joint: int, name: str, unit: str) -> tuple[Plot, Plot]:
    """Return the plots of a joint: errors [deg|mm] and torque [Nm|N] in parts."""
    shown, scale = DISPLAY[unit]
    if len(columns.time) == 0:
        return Plot(f"{name}: error [{shown}]", columns.time, ()), Plot(f"{name}: torque", columns.time, ())
    c = JointColumns(columns.time, *(column[:, joint] for column in columns[1:]))
    errors = (
        Curve("reported", scale * (c.q - c.true), REPORTED),
        Curve("calibrated", scale * (c.calibrated - c.true), CALIBRATED),
        Curve("+ interval", scale * c.interval, CALIBRATED, True),
        Curve("- interval", -scale * c.interval, CALIBRATED, True),
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
