"""Recordings of one robot, resolved once: the order of joints, the robot, error limits, and what is found of delays."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel
from catenary.units import DISPLAY
from catenary.verdict.check import KnownDelays, Passed, robot_of, verdict


@dataclass(frozen=True)
class Recordings:
    """One or more recordings of one robot, resolved at the door of a command: whatever asks of them takes this.

    Args:
        logs: Recordings, the joints of each in the order of the first one's.
        robot: Whose limits positions are held against; None if it is not known.
        max_error: Errors beyond which rows are left out, (n,) [rad|m]; None if none are.
    """

    logs: tuple[MotionLog, ...]
    robot: RobotModel | None = None
    max_error: Floats | None = None
    _delays: tuple[KnownDelays, ...] = field(init=False, repr=False, compare=False)  # of each log: found once

    def __post_init__(self) -> None:
        object.__setattr__(self, "_delays", tuple({} for _ in self.logs))

    @classmethod
    def of(
        cls, logs: Sequence[MotionLog], *, robot: str | None = None, max_error: Sequence[float] | None = None
    ) -> Self:
        """Resolve recordings: of the robot of that name or of theirs, with limits of errors per joint in deg and mm."""
        ordered = _in_one_order(logs)
        return cls(ordered, robot_of(ordered, robot), error_limits(max_error, ordered[0]))

    @property
    def period(self) -> float | None:
        """The shortest usual step between rows [s]; None if a recording has no time."""
        rates = [sampling_rate(log) for log in self.logs]
        return None if None in rates else 1.0 / max(rate for rate in rates if rate is not None)

    def judged(
        self,
        accept: Collection[str] = (),
        *,
        testing: bool = False,
        trained: tuple[Floats, Floats] | None = None,
        done: str = "fitted",
    ) -> Passed:
        """Refuse recordings that no model is to be made from, or tested on; see `verdict`."""
        return verdict(
            self.logs, accept=accept, robot=self.robot, max_error=self.max_error, testing=testing, trained=trained,
            done=done, delays=self._delays,
        )  # fmt: skip


def _in_one_order(logs: Sequence[MotionLog]) -> tuple[MotionLog, ...]:
    """Return recordings, one or more of one robot, with the joints of each in the order of the first one's."""
    if not logs:
        raise InputError("data: expected at least one recording, got none")
    for log in logs:
        a, b = logs[0].robot, log.robot
        if a is not None and b is not None and a != b:
            raise InputError(f'recordings "{logs[0].name}" and "{log.name}" are of two robots: {a} and {b}')
    return tuple(log.in_order_of(logs[0], of=f'recording "{logs[0].name}" has') for log in logs)


def error_limits(max_error: Sequence[float] | None, log: MotionLog) -> Floats | None:
    """Return the errors beyond which rows are left out, (n,) [rad|m]; None without limits.

    Args:
        max_error: Limit per joint in deg and mm.
    """
    if max_error is None:
        return None
    if len(max_error) != len(log.joint_names) or not all(limit > 0.0 for limit in max_error):
        raise InputError(
            f"max error: expected {len(log.joint_names)} positive numbers (deg, mm), one per joint, "
            f"got {list(max_error)}"
        )
    return np.array([bound / DISPLAY[unit][1] for bound, unit in zip(max_error, log.joint_units, strict=True)])


def sampling_rate(log: MotionLog) -> float | None:
    """Return rows per second of a recording, by the median of its time steps; None if it has no time."""
    steps = np.diff(log.time) if log.time is not None else np.zeros(0)
    forward = steps[steps > 0.0]  # where the clock goes back, another recording begins
    return float(1.0 / np.median(forward)) if len(forward) else None
