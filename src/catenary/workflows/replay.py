"""A recorded sensor instead of a live one: read again by the estimator, its rests found, its mounting calibrated."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.recording.import_formats.imu_recording import ImuRecording
from catenary.recording.import_formats.table_files import read_table_file
from catenary.robots.model import RobotModel
from catenary.sensing.mounting import Mounting, TumbleSection
from catenary.sensing.tumble import fit_orientations
from catenary.sensing.vector import Kind, Mailbox, tilted_gravity
from catenary.spatial import STANDARD_GRAVITY
from catenary.workflows.sense import STILL, Feed, StillReading
from catenary.workflows.tumble import TumbleOutcome

BLOCK = 0.25  # [s] over which a sensor is still or not
SHORTEST = 1.0  # [s] of a rest


class ReplayFeed(Feed):
    """A recording as a sensor that sends its samples at the times of their stamps, as fast as they are asked for."""

    def __init__(self, recording: ImuRecording) -> None:
        super().__init__(Mailbox(), has_gyroscope=recording.rate is not None)
        self._recording, self._time, self._next = recording, 0.0, 0
        # a stamp that goes back arrives when it was recorded, behind those before it
        self._arrival = np.maximum.accumulate(recording.time)

    def now(self) -> float:
        """Return the recording's time [s]."""
        return self._time

    def wait(self, seconds: float) -> None:
        """Let time pass, and the samples of that time come."""
        self._time += seconds
        r, last = self._recording, int(np.searchsorted(self._arrival, self._time, side="right"))
        for k in range(self._next, last):
            if r.rate is not None:
                self.mailbox.put(float(r.time[k]), r.rate[k], Kind.ANGULAR_RATE)
            self.mailbox.put(float(r.time[k]), r.force[k], Kind.SPECIFIC_FORCE)
        self._next = last


def rests(recording: ImuRecording) -> list[StillReading]:
    """Return the means of all pieces of a second or more in which a sensor stood still, in order."""
    found: list[StillReading] = []
    rows: list[int] = []
    numbers = np.floor(recording.time / BLOCK).astype(int)

    def close() -> None:
        if rows and recording.time[rows[-1]] - recording.time[rows[0]] >= SHORTEST - BLOCK:
            rate = None if recording.rate is None else recording.rate[rows].mean(axis=0)
            found.append(StillReading(recording.force[rows].mean(axis=0), rate))
        rows.clear()

    for number in np.unique(numbers):
        if rows and numbers[rows[-1]] < number - 1:
            close()
        here = np.flatnonzero(numbers == number).tolist()
        force = recording.force[here]
        still = len(here) >= 3 and np.isfinite(force).all() and (np.std(force, axis=0) <= STILL).all()
        if not still:
            close()
            continue
        if rows and np.abs(force.mean(axis=0) - recording.force[rows].mean(axis=0)).max() > STILL:
            close()
        rows += here
    close()
    return found


def up_of_tilts(tilts_deg: ArrayLike) -> Floats:
    """Return where up is in base axes (N, 3) of a whole robot turned by roll, then pitch, (N, 2) [deg]."""
    rows: list[Floats] = [tilted_gravity(float(r), float(p)) for r, p in np.deg2rad(np.asarray(tilts_deg))]
    up: Floats = -np.array(rows) / STANDARD_GRAVITY
    return up


def up_of_poses(model: RobotModel, q: ArrayLike, frame: str | None = None) -> Floats:
    """Return where up is in the axes of a frame (N, 3) of an arm on a level base in poses (N, n) [rad|m]."""
    # R^T z is the last row of R
    up: Floats = forward_kinematics(model, np.asarray(q, dtype=float), frame).rotation[:, 2, :]
    return up


def read_orientations(path: Path, model: RobotModel | None = None, frame: str | None = None) -> Floats:
    """Read how a sensor was turned while it rested, a row each, and return where up was (N, 3).

    Args:
        path: A table with columns roll_deg and pitch_deg of the whole robot, or with the joints of `model` by name.
        model: The arm that carries the sensor, on a level base.
        frame: Of it, to which the sensor is fixed; its tip when None.

    Raises:
        FileFormatError: No table.
        InputError: Columns are missing.
    """
    (stream,) = read_table_file(path)
    wanted = ("roll_deg", "pitch_deg") if model is None else model.joint_names
    missing = [name for name in wanted if name not in stream.columns]
    if missing:
        raise InputError(
            f"{path}: no column {', '.join(missing)}; expected {', '.join(wanted)}, got {', '.join(stream.columns)}"
        )
    rows = np.column_stack([np.asarray(stream.columns[name], dtype=float) for name in wanted])
    return up_of_tilts(rows) if model is None else up_of_poses(model, rows, frame)


def calibrate_replay(recording: ImuRecording, up: Floats, *, start: Mounting | None = None) -> TumbleOutcome:
    """Compute mounting and bias of a recorded sensor that rested in known orientations.

    Args:
        recording: With a rest of a second or more in each orientation, in order.
        start: What is known already: position, ranges, name.

    Raises:
        InputError: Another number of rests than orientations, or too few, or all alike.
    """
    still = rests(recording)
    if len(still) != len(up):
        raise InputError(
            f"the recording has {len(still)} rests of {SHORTEST:g} s or more, the orientations are {len(up)}: "
            "expected as many, in the same order"
        )
    fit = fit_orientations(np.array([s.force for s in still]), up)
    rates = [s.rate for s in still if s.rate is not None]
    mounting = fit.mounting(start, np.mean(rates, axis=0) if rates else None)
    section = TumbleSection(
        readings=len(still), residual_m_s2=fit.residual, rotation_residual_deg=None, remarks=fit.faults
    )
    return TumbleOutcome(mounting, section, fit.faults)
