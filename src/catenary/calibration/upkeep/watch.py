"""A watch in the loop that sees drift without an encoder: homing, torque, valid range against the day of training.

Every tick costs a handful of compiled sums. At the end of a window of time their means are compared with what windows
of the training day had; a torque, or a share outside the valid range, that leaves its bounds in IN_A_ROW windows raises
a flag. A registration is compared when it is told. A flag stays, with its reason in words. What the training day does
not tell, or the robot's motion does not show, is listed as not watched: silence is no promise there.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.kernels import Flags, Step, bound, finite
from catenary.calibration.model import CalibrationModel
from catenary.kernels.compiled import compiled
from catenary.plant import Joints, places_of
from catenary.units import DISPLAY, TORQUE_UNIT

Aspect = Literal["homing", "torque", "range"]
IN_A_ROW = 2  # windows beyond their bounds before a flag is raised
LEAST_SHARE = 0.5  # of a window's ticks in motion that the training saw, for its torque to be compared


@dataclass(frozen=True)
class DriftFlag:
    """A sign that a model may no longer hold."""

    joint: str
    aspect: Aspect
    time: float  # [s] of the robot, when it was raised
    reason: str  # in words


@dataclass(frozen=True)
class WatchResult:
    """What a watch has seen."""

    flags: tuple[DriftFlag, ...]
    windows: int  # that ended
    not_watched: tuple[str, ...]  # in words: aspects of which silence says nothing, and why

    @property
    def in_words(self) -> list[str]:
        """Return flags, then what was not watched, a sentence each."""
        return [
            *(f"drift? {flag.reason} (at {flag.time:.0f} s)" for flag in self.flags),
            *(f"not watched: {why}" for why in self.not_watched),
        ] or [f"no sign of drift in {self.windows} windows"]

    def as_data(self) -> dict[str, Any]:
        """Return plain data, SI."""
        return asdict(self)


class DriftWatch:
    """Looks at every tick of a robot beside a deployed model; bounded in time and memory, and raises nothing."""

    def __init__(
        self, model: CalibrationModel, joint_names: Sequence[str], joint_units: Sequence[str]
    ) -> None:
        """Match the model's joints to a robot's, by name.

        Raises:
            InputError: The robot lacks a joint of the model, or has it in another unit.
        """
        of_robot = Joints(tuple(joint_names), tuple(joint_units))
        self._places = places_of(model, of_robot, whose="watch: the robot", of="the model is for")
        self._names, self._units, self._day = model.joint_names, model.joint_units, model.trained_day
        n = len(self._names)
        self._q, self._tau, self._inside = np.zeros((1, n)), np.zeros((1, n)), np.ones((1, n), dtype=bool)
        self._ticks, self._excess, self._outside = np.zeros(2), np.zeros(n), np.zeros(n)
        self._row: dict[Aspect, NDArray[np.int64]] = {
            "torque": np.zeros(n, dtype=np.int64),
            "range": np.zeros(n, dtype=np.int64),
        }  # windows in a row beyond, counted down below
        self._flags: dict[tuple[str, Aspect], DriftFlag] = {}
        self._begin = self._last = np.nan
        self._windows = self._torque_windows = 0
        self._registered: str | None = "the robot has not told its encoders' offsets"
        self._tick = bound(self._steps())

    def _steps(self) -> list[Step]:
        n, day = len(self._names), self._day
        expected, known = np.zeros((1, n)), np.zeros(1, dtype=bool)
        tally_it = Step(
            tally, (self._tau, expected, known, self._inside), (self._ticks, self._excess, self._outside)
        )
        if day is None or day.torque is None:
            return [tally_it]
        torque, X = day.torque, np.empty((1, len(day.torque.features.names)))
        self._memory = torque.features.memory()
        return [
            *torque.features.row_steps(self._q, self._memory, X, np.ones(1)),
            Step(finite, (X,), (known,)),
            *torque.valid_range.steps(self._q, known),
            *torque.predictor.steps(X, expected),
            tally_it,
        ]

    def update(self, time: float, q: Floats, tau: Floats, inside: Flags) -> None:
        """Take one tick.

        Args:
            time: [s] of the robot.
            q: (N,) positions that the robot reports, of all its joints [rad|m].
            tau: (N,) torques [Nm|N].
            inside: (N,) whether each joint is inside the model's valid range.
        """
        if self._day is None:
            return
        if not 0.0 <= time - self._last <= self._day.window:  # another motion begins
            self._clear(time)
            if self._day.torque is not None:
                self._memory.clear()
        self._last = time
        places = self._places
        self._q[0], self._tau[0], self._inside[0] = q[places], tau[places], inside[places]
        self._tick()
        if time - self._begin >= self._day.window:
            self._judge(time)
            self._clear(time)

    def registered(self, time: float, shift: Floats) -> None:
        """Take the robot's registration, of `recording.raven_transmission.shift_of`, for the model's joints, (n,)."""
        if self._day is None or self._day.homing is None:
            return
        bounds, self._registered = self._day.homing, None
        beyond, middle = bounds.beyond(shift), 0.5 * (bounds.lower + bounds.upper)
        if (np.abs(shift - middle) > self._day.reach).any():
            self._registered = (
                "its encoders count from elsewhere, as after it was switched off; their offsets say nothing"
            )
            return
        for j in np.flatnonzero(beyond):
            unit, scale = DISPLAY[self._units[j]]
            self._raise(
                int(j),
                "homing",
                time,
                f"homed {scale * (shift[j] - middle[j]):+.2g} {unit} away from where it was in training, which its "
                f"intervals do not hold (it says nothing if the robot was switched off since)",
            )

    def result(self) -> WatchResult:
        """Return what was seen so far."""
        return WatchResult(tuple(self._flags.values()), self._windows, tuple(self._not_watched()))

    @property
    def flags(self) -> tuple[DriftFlag, ...]:
        """The flags that were raised."""
        return tuple(self._flags.values())

    def _not_watched(self) -> list[str]:
        day = self._day
        if day is None:
            return [
                "anything: the model does not know the day of its training; fit it again, to recordings "
                "with time stamps"
            ]
        found = list(day.not_watched)
        if self._windows < IN_A_ROW:
            found.append(
                f"torque and valid range: they take {IN_A_ROW} windows of {day.window:.0f} s, "
                f"of which {self._windows} ended"
            )
        elif day.torque is not None and self._torque_windows < IN_A_ROW:
            found.append(
                "torque: the robot moves where the training did not, or reports none; "
                f"{self._torque_windows} of {self._windows} windows could be compared"
            )
        if day.homing is not None and self._registered is not None:
            found.append(f"homing: {self._registered}")
        return found

    def _clear(self, time: float) -> None:
        self._begin = time
        for sums in (self._ticks, self._excess, self._outside):
            sums[:] = 0.0

    def _judge(self, time: float) -> None:
        day, (ticks, known) = self._day, self._ticks
        if day is None or ticks < 1.0:
            return
        self._windows += 1
        if day.torque is not None and known >= LEAST_SHARE * ticks:
            self._torque_windows += 1
            excess = self._excess / known
            beyond = day.torque.usual.beyond(excess)
            for j in self._in_a_row("torque", np.sign(beyond).astype(np.int64)):
                unit = TORQUE_UNIT[self._units[j]]
                reach = 0.5 * (day.torque.usual.upper[j] - day.torque.usual.lower[j])
                self._raise(
                    j,
                    "torque",
                    time,
                    f"takes {excess[j]:+.2g} {unit} against what training saw in the same motion "
                    f"({reach:.1g} {unit} are usual)",
                )
        if day.outside is not None:
            share = self._outside / ticks
            for j in self._in_a_row("range", (share > day.outside).astype(np.int64)):
                self._raise(
                    j,
                    "range",
                    time,
                    f"is outside the valid range {share[j]:.0%} of the time ({day.outside[j]:.0%} are usual)",
                )

    def _in_a_row(self, aspect: Aspect, sign: NDArray[np.int64]) -> list[int]:
        """Return joints that have been beyond on one side (1, -1; 0 within) for windows enough."""
        row = self._row[aspect]
        row[:] = np.where(sign == 0, 0, np.where(sign == np.sign(row), row + sign, sign))
        return [int(j) for j in np.flatnonzero(np.abs(row) >= IN_A_ROW)]

    def _raise(self, joint: int, aspect: Aspect, time: float, reason: str) -> None:
        name = self._names[joint]
        first = self._flags.get((name, aspect))
        since = time if first is None else first.time
        self._flags[name, aspect] = DriftFlag(name, aspect, since, f"{name} {reason}")


@compiled
def tally(
    tau: Floats,
    expected: Floats,
    known: Flags,
    inside: Flags,
    ticks: Floats,
    excess: Floats,
    outside: Floats,
) -> None:
    """Add rows to a window's sums.

    Args:
        tau: (N, n) torques [Nm|N]; a row that holds NaN is not compared.
        expected: (N, n) what the training saw in the same motion.
        known: (N,) whether it saw such motion.
        inside: (N, n) whether each joint is inside the valid range.
        ticks: (2,) rows, and those whose torques are compared.
        excess: (n,) sums of torque less expected [Nm|N].
        outside: (n,) rows outside the valid range.
    """
    for row in range(len(tau)):
        ticks[0] += 1.0
        compared = known[row]
        for j in range(tau.shape[1]):
            compared = compared and np.isfinite(tau[row, j])
            if not inside[row, j]:
                outside[j] += 1.0
        if compared:
            ticks[1] += 1.0
            for j in range(tau.shape[1]):
                excess[j] += tau[row, j] - expected[row, j]
