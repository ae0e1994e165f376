"""Correction of positions in the control loop: it comes on slowly, and the torques that it takes are slow."""

import math
import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats
from catenary.control.realtime import Durations
from catenary.plant import JointState, Plant

_FADE_TIME_S = 1.5  # from a leap until all of it has come on
SLOW_TORQUE_S = 0.2  # time constant of the torques that a correction takes: slower than an arm under PD


class Fade:
    """What is left out of a correction that leaps: all of the leap at first, then in equal steps ever less."""

    def __init__(self, correction: Floats, period: float) -> None:
        """Begin at a correction (n,) [rad|m] that is already acting, in ticks of `period` [s]."""
        self._last, self._share = correction, period / _FADE_TIME_S
        self._remaining = self._step = np.zeros(len(correction))

    def remainder(self, correction: Floats, leaps: ArrayLike) -> Floats:
        """Return the part of a correction that is not applied yet (n,) [rad|m]; `leaps` marks a change of source."""
        leap = np.where(leaps, np.nan_to_num(correction - self._last), 0.0)
        self._last = correction
        if leap.any():
            self._remaining = self._remaining + leap
            self._step = self._share * np.abs(self._remaining)
        remaining = self._remaining
        self._remaining = remaining - np.clip(remaining, -self._step, self._step)
        return remaining


class SlowTorque:
    """The torques that a correction takes where control takes the corrected positions: a first-order low-pass.

    A correction of -tau / k undoes the stretch of a cable of stiffness k. PD of gain kp at such positions commands
    tau = -kp (q - tau / k): at once, where kp is above k, it pushes the arm the way that it is off. Behind a low-pass
    slower than the arm that loop's gain is kp / (kp + k), always below one.
    """

    def __init__(self, period: float) -> None:
        """Begin at the first torques, in ticks of `period` [s]."""
        self._tau: Floats | None = None
        self._share = -math.expm1(-period / SLOW_TORQUE_S)

    def of(self, tau: Floats) -> Floats:
        """Return a tick's torques (n,) [Nm|N], slow; one that is not finite is passed on, and forgotten."""
        last = np.where(np.isfinite(tau), tau, 0.0) if self._tau is None else self._tau
        step = self._share * (tau - last)
        known = np.isfinite(step)
        self._tau = last + np.where(known, step, 0.0)
        return np.where(known, self._tau, tau)


class StateCorrector(Protocol):
    """A source of true joint positions for the loop, such as a deployed calibration model."""

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Get ready for a robot, or raise; forget all previous ticks."""

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write calibrated positions (n,) [rad|m], whether each is inside the valid range, and half-widths [rad|m]."""


class Correction:
    """A corrector in a loop, asked tick by tick; where a controller takes the positions, leaps come on slowly."""

    def __init__(self, corrector: StateCorrector, plant: Plant, state: JointState, rate_hz: float) -> None:
        """Get ready, and ask where the plant stands; the ticks to come are the corrector's first."""
        n = len(state.q)
        self._corrector, self._period, self._is_first = corrector, 1.0 / rate_hz, True
        self._fade: Fade | None = None
        self._slow = SlowTorque(self._period)
        self.durations = Durations()
        self.inside: Flags = np.ones(n, dtype=bool)  # (n,) of the last tick
        self.at_start = np.zeros(n)  # [rad|m] that is added to reported positions
        corrector.prepare(plant.joint_names, plant.joint_units, rate_hz)
        corrector.correct_state(state, self.at_start, self.inside, np.empty(n))
        self.at_start -= state.q
        corrector.prepare(plant.joint_names, plant.joint_units, rate_hz)

    def smooth(self, acting: Floats) -> None:
        """Have a controller take the positions, which see the correction `acting` (n,) [rad|m] already."""
        self._fade = Fade(acting, self._period)

    def corrected(self, state: JointState) -> JointState:
        """Return a tick's state with calibrated positions and their half-widths."""
        n = len(state.q)
        q, was_inside, interval = np.empty(n), self.inside, np.empty(n)
        self.inside = np.empty(n, dtype=bool)
        began = time.perf_counter()
        known = state if self._fade is None else state._replace(tau=self._slow.of(state.tau))
        self._corrector.correct_state(known, q, self.inside, interval)
        if not self._is_first:
            self.durations.add(time.perf_counter() - began)
        if self._fade is not None:
            remaining = self._fade.remainder(q - state.q, (self.inside != was_inside) | self._is_first)
            q -= remaining
            interval += np.abs(remaining)
        self._is_first = False
        return JointState(state.time, q, *state[2:8], interval)
