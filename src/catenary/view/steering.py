"""Motion, controller and correction, changed without a jump while a control loop runs."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats, as_array
from catenary.control.correction import Fade, StateCorrector
from catenary.plant import JointState
from catenary.trajectories.reference import Reference, Rest, Trajectory

_STOP_S = 0.4  # [s] in which a motion that is left comes to rest

Motion = Callable[[Floats], Trajectory]  # makes a motion that begins at joint positions (n,) [rad|m]


class SteeredTrajectory:
    """A motion that repeats until another is wanted: then it slows down along its own path, and the next begins."""

    duration = np.inf

    def __init__(self, q: Floats) -> None:
        """Rest at q (n,) [rad|m]."""
        self._motion: Trajectory = Rest(q, 0.0)
        self._recipe: Motion | None = None
        self._next: Motion | None = None
        self._place, self._rate, self._time = 0.0, 1.0, 0.0  # along the motion; of it; of the last call

    def follow(self, recipe: Motion | None) -> None:
        """Come to rest, then follow the motions that a recipe makes, one after the other; None rests."""
        self._next = _rest if recipe is None else recipe

    def rest_at(self, q: Floats) -> None:
        """Be at rest at q (n,) [rad|m] at once, as where an arm was led by hand."""
        self._motion, self._recipe, self._next = Rest(q, 0.0), None, None
        self._place, self._rate = 0.0, 1.0

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s], not before the last one that was asked for."""
        step = max(0.0, t - self._time)
        self._time = t
        slower = 0.0
        if self._next is not None:
            rate = max(0.0, self._rate - step / _STOP_S)
            slower = -1.0 / _STOP_S if rate > 0.0 else 0.0
            self._place += 0.5 * (self._rate + rate) * step
            self._rate = rate
        else:
            self._place += step
        at_rest = self._rate == 0.0 or self._place >= self._motion.duration
        if at_rest and (self._next is not None or self._recipe is not None):
            self._begin(self._motion(min(self._place, self._motion.duration)).q)
            slower = 0.0
        q, qd, qdd = self._motion(self._place)
        return Reference(q, self._rate * qd, self._rate**2 * qdd + slower * qd)

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at times (N,) [s], in their order; asking moves the motion on."""
        rows = [self(float(t)) for t in as_array("times", times, (None,))]
        q, qd, qdd = (np.array(part) for part in zip(*rows, strict=True))
        return q, qd, qdd

    def _begin(self, q: Floats) -> None:
        recipe = self._next if self._next is not None else self._recipe
        self._next, self._place, self._rate = None, 0.0, 1.0
        self._motion = Rest(q, 0.0) if recipe is None else recipe(q)
        self._recipe = None if recipe is _rest else recipe


def _rest(q: Floats) -> Trajectory:
    return Rest(q, 0.0)


class SwitchedCorrector:
    """A model that always corrects, and whose correction is faded into the loop once switched on, and out again."""

    def __init__(
        self, corrector: StateCorrector, whole: Callable[[JointState], JointState], n: int, period: float
    ) -> None:
        """Take a corrector, off, for the `whole` robot's state, whose first n joints are the loop's; `period` [s]."""
        self._corrector, self._whole, self._n = corrector, whole, n
        self._fade = Fade(np.zeros(n), period)
        self.is_on = self._was_on = False
        self.calibrated, self.interval = np.full(n, np.nan), np.full(n, np.nan)
        self.inside: Flags = np.ones(n, dtype=bool)

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Do nothing: the model knows the whole robot."""

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write positions (n,), reported, calibrated or on the way from one to the other, flags and half-widths."""
        whole = self._whole(state)
        size, n = len(whole.q), self._n
        q, flags, widths = np.empty(size), np.empty(size, dtype=bool), np.empty(size)
        self._corrector.correct_state(whole, q, flags, widths)
        self.calibrated, self.inside, self.interval = q[:n], flags[:n], widths[:n]
        correction = self.calibrated - state.q if self.is_on else np.zeros(n)
        out[:] = state.q + correction - self._fade.left_out(correction, self.is_on != self._was_on)
        self._was_on = self.is_on
        inside[:], interval[:] = self.inside, self.interval
