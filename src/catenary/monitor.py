"""A robot, or a row of its recording, at one instant: what deserves a warning, and its picture in a terminal."""

from collections import deque
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.plant import OperatingState
from catenary.sensing.gravity_vector import tilt_of
from catenary.terminal_text import range_bar, visible
from catenary.units import DISPLAY, in_words

_LIMIT_MARGINS = {"rad": np.deg2rad(2.0), "m": 0.005}  # from a limit
_STALE_GRAVITY_S = 0.1  # [s], as old as the gravity estimator lets a reading be before it calls it stale
_RATE_WINDOW_S = 1.0  # [s] over which rates are counted


# of a snapshot's plain data, where they say more than its fields
_KEYS = {
    "joint_names": "joints", "joint_units": "units", "calibrated": "q_calibrated", "interval": "q_interval",
    "inside": "inside_valid_range", "encoder": "q_encoder", "gravity_tau": "gravity_torque",
    "gravity_age": "gravity_age_s", "operating": "state", "late": "late_ticks", "error": "true_error",
    "calibrated_from_encoders": "calibrated_tip_from_encoders",
}  # fmt: skip


class Snapshot(NamedTuple):
    """A robot at one instant; None for what is not known."""

    time: float  # [s] of the robot
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    q: Floats  # (n,) [rad|m] reported
    setpoint: Floats | None = None
    calibrated: Floats | None = None
    inside: NDArray[np.bool_] | None = None  # (n,) inside the model's valid range
    interval: Floats | None = None  # (n,) half-width about `calibrated` [rad|m]; NaN for a joint without
    encoder: Floats | None = None  # (n,) external encoders, or a recording's truth; NaN: none
    tau: Floats | None = None  # (n,) [Nm|N]
    gravity_tau: Floats | None = None  # (k,) what holds the first k joints still [Nm|N]
    gravity: Floats | None = None  # (3,) [m/s2] in the base frame
    gravity_age: float = np.inf  # [s]; inf: nominal
    operating: OperatingState | None = None
    fault: str = ""  # why the robot is in FAULT; empty if it does not say
    lower: Floats | None = None
    upper: Floats | None = None
    rate_hz: float | None = None  # at which states come
    late: int = 0  # ticks late within the last second
    silent: str | None = None  # the error that the robot's silence raised
    error: Floats | None = None  # (k,) reported less true position of the first k joints; None but in a simulation
    tip: Floats | None = None  # (3,) [m] in the base frame, by reported joints
    tip_error: float | None = None  # [m] from where the tip really is; None but in a simulation
    tip_from_encoders: float | None = None  # [m] from where external encoders say that it is
    calibrated_from_encoders: float | None = None  # [m] the same, by calibrated joints
    # what a program that moves a simulated robot knows besides
    feedback: Floats | None = None  # (n,) [Nm|N] what the errors asked for: the PD term
    assumed: Floats | None = None  # (3,) [m/s2] gravity as the controller takes it to be
    actual: Floats | None = None  # (3,) [m/s2] as it is
    doing: str = ""  # said behind its state
    notes: tuple[str, ...] = ()  # further warnings

    @property
    def state(self) -> str:
        """What it does, in words."""
        if self.operating is None:
            return f"recording{self.doing}"
        state, is_homed, is_busy = self.operating
        return f"{state}, {'busy' if is_busy else 'homed' if is_homed else 'not homed'}{self.doing}"

    @property
    def true(self) -> Floats | None:
        """Where the first joints are: as external encoders tell it where a model learned from them, or alone know it.

        A RAVEN-II's encoders call other places zero than its joints.
        """
        if self.encoder is not None and (self.calibrated is not None or self.error is None):
            return self.encoder
        return None if self.error is None else self.q[: len(self.error)] - self.error

    def warnings(self) -> list[str]:
        """Return the warnings, most severe first."""
        texts: list[str] = []
        if self.silent is not None:
            texts.append(f"stale: {self.silent}")
        if self.operating is not None:
            if self.operating.state == "FAULT":
                texts.append(f"the robot is in FAULT: {self.fault or 'it does not say why'}")
            if not self.operating.is_homed and not self.operating.is_busy:
                texts.append("not homed: joint positions mean nothing")
        if np.isfinite(self.gravity_age) and self.gravity_age > _STALE_GRAVITY_S:
            texts.append(f"gravity is {self.gravity_age:.2f} s old")
        if self.inside is not None and not self.inside.all():
            names = [name for name, ok in zip(self.joint_names, self.inside, strict=True) if not ok]
            texts.append(f"outside the model's valid range: {', '.join(names)}")
        if self.lower is not None and self.upper is not None:
            margin = np.array([_LIMIT_MARGINS[unit] for unit in self.joint_units])
            near = np.flatnonzero((self.q < self.lower + margin) | (self.q > self.upper - margin))
            if len(near):
                texts.append(f"near a limit: {', '.join(self.joint_names[j] for j in near)}")
        if self.late:
            texts.append(f"{self.late} ticks of this program late within {_RATE_WINDOW_S:g} s")
        return [*texts, *self.notes]

    def as_data(self) -> dict[str, Any]:
        """Return plain data, SI; null for what is not known."""
        left_out = ("lower", "upper", "silent", "feedback", "assumed", "actual", "doing", "notes")
        data = {_KEYS.get(name, name): value for name, value in self._asdict().items() if name not in left_out}
        return data | {
            "state": None if self.operating is None else self.operating._asdict(),
            "fault": self.fault or None,
            "warnings": self.warnings(),
        }


class EventRate:
    """Counts events, and their mean rate, over the last second."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def count(self, now: float, times: int = 1) -> None:
        """Count events at a time [s]."""
        self._times.extend([now] * times)
        self._drop(now)

    def within(self, now: float) -> int:
        """Return the number of events within the last second."""
        self._drop(now)
        return len(self._times)

    def hertz(self, now: float) -> float | None:
        """Return the mean rate [Hz]; None before two events."""
        self._drop(now)
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])

    def _drop(self, now: float) -> None:
        while self._times and self._times[0] < now - _RATE_WINDOW_S:
            self._times.popleft()


_BAR_WIDTH = 12  # characters of a joint's range
_COLUMNS = {  # by heading: field of the snapshot, characters
    "reported": ("q", 10),
    "calibrated": ("calibrated", 11),
    "+/-": ("interval", 8),
    "set": ("setpoint", 10),
    "encoder": ("encoder", 10),
    "error": ("error", 8),
    "torque": ("tau", 8),
    "gravity": ("gravity_tau", 8),
}


def monitor_lines(name: str, shot: Snapshot, columns: int = 80, lines: int = 24, *, colour: bool = False) -> list[str]:
    """Return the lines of the monitor's screen.

    Args:
        columns: Width [characters]; columns of the table that do not fit are left out.
        lines: Height; exactly as many are returned.
        colour: Whether warnings are red; escape codes do not count towards `columns`.
    """
    shown = [_left_right(f"catenary monitor  {name}", shot.state, columns)]
    rate = "-" if shot.rate_hz is None else f"{shot.rate_hz:.0f} Hz"
    shown += [_left_right(f"time {shot.time:10.2f} s", f"states {rate:>8}", columns), ""]
    heads = [head for head, (field, _) in _COLUMNS.items() if _is_known(getattr(shot, field), head)]
    while heads and 14 + sum(_COLUMNS[head][1] for head in heads) > columns:
        heads.pop()  # half a column tells nothing
    titles = "".join(head.rjust(_COLUMNS[head][1]) for head in heads)
    has_room = 14 + len(titles) + 3 + _BAR_WIDTH + 2 <= columns
    shown.append(f"{'':<14}{titles}{'   range' if has_room else ''}")
    for j, joint in enumerate(shot.joint_names):
        cells = "".join(_cell(shot, head, j) for head in heads)
        line = f"{joint[:9]:<10}{DISPLAY[shot.joint_units[j]][0]:<4}{cells}"
        if has_room and shot.lower is not None and shot.upper is not None:
            line += f"   {range_bar(shot.q[j], shot.lower[j], shot.upper[j], _BAR_WIDTH)}"
        shown.append(line)
    shown += ["", _gravity(shot)]
    if shot.tip is not None:  # by reported joints and, in a simulation, how far from where it is
        x, y, z = 1e3 * shot.tip
        away = "" if shot.tip_error is None else f"  {_tip_errors(shot)}"
        shown.append(f"tip {x:.1f} {y:.1f} {z:.1f} mm{away}")
    shown.append("")
    shown = [visible(line.replace("\n", " "))[:columns].rstrip() for line in shown]
    warned = [  # why a robot is in FAULT is not cut off
        line
        for text in shot.warnings()
        for line in wrap(visible(f"! {text}".replace("\n", " ")), max(8, columns), subsequent_indent="  ")
    ]
    shown += [f"\x1b[31m{line}\x1b[0m" if colour else line for line in warned] or ["no warnings"]
    shown = shown[: max(0, lines - 1)]
    return [*shown, *[""] * (lines - 1 - len(shown)), "Q quit"[:columns]][:lines]


def plain_line(shot: Snapshot) -> str:
    """Return one line for a pipe or a file: time, state, joints in deg and mm, warnings.

    Reported joints by name; calibrated and measured ones, where there are any, in the same order and units.
    """
    named = zip(shot.joint_names, shot.q, shot.joint_units, strict=True)
    values = " ".join(f"{joint}={in_words(value, unit, 2).replace(' ', '')}" for joint, value, unit in named)
    for name, others in (("calibrated", shot.calibrated), ("measured", shot.encoder)):
        if others is not None and np.isfinite(others).any():
            encoders = zip(others, shot.joint_units, strict=False)  # a robot's encoders are at its first joints
            shown = (f"{DISPLAY[unit][1] * value:.2f}" if np.isfinite(value) else "-" for value, unit in encoders)
            values += f"  {name} {' '.join(shown)}"
    if shot.tip_error is not None:
        values += f"  tip {_tip_errors(shot)}"
    warnings = "; ".join(shot.warnings())
    return f"{shot.time:.2f} s  {shot.state}  {values}" + (f"  ! {warnings}" if warnings else "")


def _tip_errors(shot: Snapshot) -> str:
    text = f"error {1e3 * (shot.tip_error or 0.0):.2f} mm"
    calibrated, reported = shot.calibrated_from_encoders, shot.tip_from_encoders
    if calibrated is None or reported is None:
        return text
    return f"{text}; by encoders {1e3 * reported:.2f}, calibrated {1e3 * calibrated:.2f} mm"


def _cell(shot: Snapshot, head: str, j: int) -> str:
    field, width = _COLUMNS[head]
    values: Floats = getattr(shot, field)
    if j >= len(values) or not np.isfinite(values[j]):
        return "-".rjust(width)
    if head in ("torque", "gravity"):
        return f"{values[j]:.3f}".rjust(width)  # [Nm], [N]
    outside = head == "calibrated" and shot.inside is not None and not shot.inside[j]
    return f"{DISPLAY[shot.joint_units[j]][1] * values[j]:.2f}{'?' if outside else ''}".rjust(width)


def _is_known(values: Floats | None, head: str) -> bool:
    """Return True if a column is shown: intervals only of a model that has some."""
    return values is not None and (head != "+/-" or not np.isnan(values).all())


def _gravity(shot: Snapshot) -> str:
    if shot.gravity is None:
        return "gravity  not known"
    x, y, z = shot.gravity
    tilt = tilt_of(shot.gravity) if shot.gravity.any() else (np.nan, np.nan)
    roll, pitch = np.round(np.rad2deg(tilt), 2) + 0.0  # no -0.00
    age = f"age {1e3 * shot.gravity_age:.0f} ms" if np.isfinite(shot.gravity_age) else "nominal"
    return f"gravity {x:7.3f} {y:7.3f} {z:7.3f} m/s2  roll {roll:6.2f} pitch {pitch:6.2f} deg  {age}"


def _left_right(left: str, right: str, columns: int) -> str:
    return left + " " * max(2, columns - len(left) - len(right)) + right
