"""Curves over the last half minute: errors of a joint, its torque in parts, rates and ages."""

from collections import deque
from collections.abc import Callable
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
    time: Floats  # (K,) [s]
    curves: tuple[Curve, ...]

    def known(self) -> tuple[Curve, ...]:
        """Return the curves of which something is known; where it is not they go on level, for no gap can be drawn."""
        return tuple(
            curve._replace(values=_level(curve.values))
            for curve in self.curves
            if np.isfinite(curve.values).any()
        )


def _level(values: Floats) -> Floats:
    """Return values (K,) with those that are not finite replaced by the last one before, or the first one after."""
    finite = np.isfinite(values)
    places = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
    return values[np.where(places < 0, int(np.argmax(finite)), places)]


REPORTED, CALIBRATED, TRUE, GRAVITY, PD, REST = (
    "#4b6b94",
    "#1f9d55",
    "#e07b00",
    "#7a4fbf",
    "#c0392b",
    "#8a8f98",
)


class Curves:
    """States of the last half minute, and what is drawn of them."""

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

    def plots(self, joint: int) -> tuple[Plot, Plot, Plot]:
        """Return the plots of a joint: errors [deg|mm], torque [Nm|N], the loop."""
        unit = self._units[joint]
        shown, scale = DISPLAY[unit]
        name = self.joint_names[joint]
        time = np.array([state.time for state in self._states])

        def of(value: Callable[[ViewState], float]) -> Floats:
            return np.array([value(state) for state in self._states], dtype=float)

        def error(value: Callable[[ViewState], float]) -> Floats:
            return scale * of(value)

        errors = (
            Curve("reported", error(lambda s: s.q[joint] - s.true[joint]), REPORTED),
            Curve("calibrated", error(lambda s: s.calibrated[joint] - s.true[joint]), CALIBRATED),
            Curve("+ interval", error(lambda s: s.interval[joint]), CALIBRATED, True),
            Curve("- interval", error(lambda s: -s.interval[joint]), CALIBRATED, True),
            Curve("tracking", error(lambda s: s.q[joint] - s.setpoint[joint]), REST),
        )
        torques = (
            Curve("total", of(lambda s: s.tau[joint]), REPORTED),
            Curve("gravity", of(lambda s: s.gravity_tau[joint]), GRAVITY),
            Curve("PD", of(lambda s: s.feedback[joint]), PD),
            Curve("friction, inertia", of(lambda s: s.tau[joint] - s.gravity_tau[joint]), REST, True),
        )
        loop = (
            Curve("rate %", of(lambda s: 100.0 * s.rate), REPORTED),
            Curve("late ticks/s", of(lambda s: s.late), PD),
            Curve("gravity age ms", of(lambda s: 1e3 * s.gravity_age), GRAVITY),
        )  # fmt: skip
        return (
            Plot(f"{name}: error [{shown}]", time, errors),
            Plot(f"{name}: torque [{TORQUE_UNIT[unit]}]", time, torques),
            Plot("loop", time, loop),
        )
