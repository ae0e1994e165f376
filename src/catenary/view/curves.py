"""Curves over the last half minute: errors of a joint, its torque in parts, rates and ages."""

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.monitor import Snapshot
from catenary.plant import Jointed
from catenary.units import DISPLAY, TORQUE_UNIT
from catenary.view.shown import numbers

_SPAN_S = 30.0  # [s]
SPACING_S = 0.1  # [s] between two of their points


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


_REPORTED, _CALIBRATED, _TRUE, _GRAVITY, _PD, _REST = ("#4b6b94", "#1f9d55", "#e07b00", "#7a4fbf", "#c0392b", "#8a8f98")


# of a snapshot
_OF_JOINTS = ("q", "true", "calibrated", "interval", "setpoint", "tau", "gravity_tau", "feedback")


class Curves:
    """What is drawn of the last half minute of states, or of the part of a recording around the present one.

    A recording has an array (K, n) [SI] for each of _OF_JOINTS that it knows, and its `time` (K,) [s].
    """

    def __init__(
        self, joints: Jointed, recording: Mapping[str, Floats] | None = None, nominal_hz: float = np.nan
    ) -> None:
        """Begin without any state of a robot whose ticks come at a rate [Hz]."""
        self._names, self._units, self._recording = joints.joint_names, joints.joint_units, recording
        self._nominal_hz = nominal_hz
        self.span = (
            (-_SPAN_S, 0.0) if recording is None else (-0.5 * _SPAN_S, 0.5 * _SPAN_S)
        )  # [s] from now that is drawn
        self._states: deque[Snapshot] = deque(maxlen=round(_SPAN_S / SPACING_S))
        self._now = 0.0

    def add(self, state: Snapshot) -> None:
        """Take a state; those too close to the last are left out, and time that goes back restarts them."""
        self._now = state.time
        if self._states and state.time < self._states[-1].time:
            self._states.clear()
        if not self._states or state.time - self._states[-1].time >= SPACING_S - 1e-9:
            self._states.append(state)

    def plots(self, joint: int) -> tuple[Plot, ...]:
        """Return the plots of a joint: errors [deg|mm], torque [Nm|N] and, of a robot that runs, the loop."""
        name, unit = self._names[joint], self._units[joint]
        if self._recording is not None:
            near = np.abs(self._recording["time"] - self._now) <= 0.5 * _SPAN_S
            part = {key: column[near] for key, column in self._recording.items()}
            return joint_plots(part, part["time"] - self._now, joint, name, unit)
        n, states = len(self._names), self._states
        columns = {key: np.array([numbers(getattr(state, key), n) for state in states]) for key in _OF_JOINTS}
        time, rate, late, age = np.array(
            [(s.time - states[-1].time, s.rate_hz or np.nan, s.late, s.gravity_age) for s in states], dtype=float
        ).T.reshape(4, -1)
        loop = (
            Curve("rate %", 100.0 * rate / self._nominal_hz, _REPORTED),
            Curve("late ticks/s", late, _PD),
            Curve("gravity age ms", 1e3 * age, _GRAVITY),
        )
        return (*joint_plots(columns, time, joint, name, unit), Plot("loop", time, loop))


def joint_plots(columns: Mapping[str, Floats], time: Floats, joint: int, name: str, unit: str) -> tuple[Plot, Plot]:
    """Return the plots of a joint: errors [deg|mm] and torque [Nm|N] in parts."""
    shown, scale = DISPLAY[unit]
    titles = f"{name}: error [{shown}]", f"{name}: torque [{TORQUE_UNIT[unit]}]"
    if len(time) == 0:
        return Plot(titles[0], time, ()), Plot(titles[1], time, ())

    def of(key: str) -> Floats:
        return columns[key][:, joint] if key in columns else np.full(len(time), np.nan)

    q, true, tau, gravity, interval = map(of, ("q", "true", "tau", "gravity_tau", "interval"))
    errors = (
        Curve("reported", scale * (q - true), _REPORTED),
        Curve("calibrated", scale * (of("calibrated") - true), _CALIBRATED),
        Curve("interval \u00b1", scale * interval, _CALIBRATED, True),
        Curve("", -scale * interval, _CALIBRATED, True),
        Curve("tracking", scale * (q - of("setpoint")), _REST),
    )
    torques = (
        Curve("total", tau, _REPORTED),
        Curve("gravity", gravity, _GRAVITY),
        Curve("PD", of("feedback"), _PD),
        Curve("friction, inertia", tau - gravity, _REST, True),
    )
    return Plot(titles[0], time, errors), Plot(titles[1], time, torques)
