"""What something outside asks of an arm's joints in a recording, by identified parameters, with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.external_torque import IN_95_PERCENT, ExternalTorque, MomentumObserver, external_wrench
from catenary.files import write_atomically
from catenary.identification.identification import Identification
from catenary.identification.identify_options import filter_of
from catenary.identification.residuals import rms
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.units import TORQUE_UNIT

STEADY = 0.7  # of the RMS, and of the interval, from which on a mean is a torque that was there all along
PAUSE = 3.0  # usual steps of time: after a longer one the observer begins anew
WRENCH = (*(f"force:{axis} [N]" for axis in "xyz"), *(f"moment:{axis} [Nm]" for axis in "xyz"))


class JointPush(NamedTuple):
    """What one joint felt."""

    joint: str
    unit: str
    largest: float  # [Nm or N]
    time: float  # [s] when
    half_width: float
    beyond: float  # share of the rows outside of the interval about zero


@dataclass(frozen=True)
class ExternalTorques:
    """External torques of one recording, and the wrench on the tip that asks for them, in base axes."""

    log: str
    model: RobotModel
    time: Floats  # (N,) [s]
    torque: Floats  # (N, n) [Nm or N] by inverse dynamics
    half_width: Floats  # (n,) within which 95 of 100 lie where nothing touches the arm
    observed: Floats | None  # (N, n) by the momentum observer
    wrench: Floats  # (N, 6) force [N], moment [Nm]; NaN of what the joints do not feel
    wrench_half_width: Floats  # (N, 6)
    notes: tuple[str, ...]

    @property
    def joints(self) -> list[JointPush]:
        """What each joint felt."""
        rows, size = np.abs(self.torque).argmax(axis=0), np.abs(self.torque)
        return [
            JointPush(
                name, TORQUE_UNIT[unit], float(self.torque[rows[k], k]), float(self.time[rows[k]]),
                float(self.half_width[k]), float(np.mean(size[:, k] > self.half_width[k])),
            )
            for k, (name, unit) in enumerate(zip(self.model.joint_names, self.model.joint_units, strict=True))
        ]  # fmt: skip

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "log": self.log,
            "rows": len(self.time),
            "joints": [joint._asdict() for joint in self.joints],
            "frame": self.model.tip,
            "largest_wrench": self.strongest(),
            "notes": list(self.notes),
        }

    def strongest(self) -> dict[str, Any] | None:
        """Return the wrench of the largest force, and when; None where the joints do not tell it."""
        force = np.linalg.norm(self.wrench[:, :3], axis=1)
        if not np.isfinite(force).any():
            return None
        row = int(np.nanargmax(force))
        return {
            "time": float(self.time[row]),
            "wrench": self.wrench[row].tolist(),
            "half_width": self.wrench_half_width[row].tolist(),
        }

    def write(self, path: Path) -> None:
        """Write a row for each of the recording's, as CSV."""
        named = [
            f"{name} [{TORQUE_UNIT[unit]}]"
            for name, unit in zip(self.model.joint_names, self.model.joint_units, strict=True)
        ]
        within = np.tile(self.half_width, (len(self.time), 1))
        parts: list[tuple[str, Sequence[str], Floats]] = [("external", named, self.torque), ("within", named, within)]
        if self.observed is not None:
            parts.append(("momentum", named, self.observed))
        parts += [("tip", WRENCH, self.wrench), ("within:tip", WRENCH, self.wrench_half_width)]
        header = ["t [s]", *(f"{kind}:{name}" for kind, names, _ in parts for name in names)]
        rows = np.column_stack([self.time, *(values for _, _, values in parts)])
        lines = [",".join(header), *(",".join(f"{v:.9g}" for v in row) for row in rows)]
        write_atomically(path, ("\n".join(lines) + "\n").encode())


def external_torques(result: Identification, pushed: Samples, unloaded: Sequence[Samples] = ()) -> ExternalTorques:
    """Return what identified parameters leave of a recording's torques: M qdd + C qd + g + friction - tau.

    The interval is 1.96 times the RMS that they leave of recordings that were not fitted: of `unloaded` ones, else of
    the tests of the identification. A second opinion comes from momentum, which needs no acceleration.
    """
    torque = result.predict_samples(pushed) - pushed.tau
    notes = list[str]()
    if unloaded:
        deviation = rms(np.concatenate([result.predict_samples(part) - part.tau for part in unloaded]))
    else:
        deviation = np.max([each.rms for each in result.tests or result.training], axis=0)
        if not result.tests:
            notes.append("intervals are by the residual of the recordings that were fitted: give one with --unloaded")
    half_width = IN_95_PERCENT * deviation
    told = np.maximum(half_width, 1e-9 * max(1.0, float(half_width.max())))
    wrenches = [
        external_wrench(result.model, q, ExternalTorque(row, told)) for q, row in zip(pushed.q, torque, strict=True)
    ]
    wrench, width = (np.array(values) for values in zip(*wrenches, strict=True))
    if not np.isfinite(wrench).any():
        notes.append(f"{result.model.n} joints tell no force on {result.model.tip} apart from its other parts")
    for k, (name, mean) in enumerate(zip(result.model.joint_names, torque.mean(axis=0), strict=True)):
        if abs(mean) > STEADY * max(half_width[k], rms(torque)[k]):
            unit = TORQUE_UNIT[result.model.joint_units[k]]
            notes.append(
                f"{name}: {mean:+.3g} {unit} all along: a zero of its torque that shifted looks like a steady push; "
                "begin the recording untouched"
            )
    observed, why = _observed(result, pushed)
    notes += [] if why is None else [f"no momentum observer: {why}"]
    return ExternalTorques(
        pushed.name, result.model, pushed.time, torque, half_width, observed, wrench, width, tuple(notes)
    )


def _observed(result: Identification, pushed: Samples) -> tuple[Floats | None, str | None]:
    """Return external torques (N, n) by momentum, or why there are none."""
    if result.phi is None or result.options.terms == "static" or pushed.base is not None:
        return None, "it needs masses and a motion on a base at rest (not --free, not --terms static)"
    robot = result.robot()
    loads = known_loads(robot)
    if loads is not None and loads.depends_on_load:
        return None, "friction grows with the load, and so with accelerations"
    observer = MomentumObserver(robot, cutoff_hz=filter_of(robot, result.options).cutoff_hz, loads=loads)
    steps = np.diff(pushed.time, prepend=pushed.time[0])
    usual = float(np.median(steps[1:]))
    down = np.broadcast_to(pushed.gravity_rows(np.array(result.options.gravity)), (len(pushed), 3))
    measured, shown = pushed.tau + pushed.known, np.empty_like(pushed.q)
    for k, step in enumerate(steps):
        if not 0.0 < step <= PAUSE * usual:
            observer.reset()
        shown[k] = observer.update(pushed.q[k], pushed.qd[k], measured[k], down[k], max(step, 1e-9))
    return shown, None
