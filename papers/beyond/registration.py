"""What a homing writes down: the registration of the motors' encoders, as a shift of the joints that a robot reports.

A robot's encoders count on through a homing; only the offsets change that are taken off their counts. So a registration
can be read from the offsets, compared with another, and taken back.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats, frozen
from catenary.raven2.transmission import COUNTS_PER_RADIAN
from catenary.simulation.cable_parameters import Firmware
from catenary.simulation.firmware import STOP_FOUND
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER
from catenary.transmission.cable_elasticity import joints_of
from catenary.workflows.robot.motion import move_to
from papers.calibration.recordings import START, draws, homed
from papers.experiment import Result, run

N = len(START)
AXES = ("shoulder", "elbow", "insertion")
OFFSETS = tuple(f"encoffsets:{axis}" for axis in AXES)
TRACE_TICKS = 40  # of 1 ms between the points of a homing's picture
HOME_POSE = frozen(np.array([np.deg2rad(30.0), np.deg2rad(90.0), 0.40]))
# the box's corner from which joint 2 is first by most
ELBOW_FIRST = frozen(np.array([CALIBRATION_UPPER[0], CALIBRATION_UPPER[1], 0.38]))


@dataclass(frozen=True)
class Seek:
    """How the positioning joints met their stops in one homing; true positions [rad, rad, m]."""

    stops: Floats  # (3, 3) row j: the joints as joint j met its stop
    registered: Floats  # (3,) the joints as their encoders were registered
    time: Floats  # (T,) [s] since the joints began to look for their stops
    q: Floats  # (T, 3) from there to the registration

    @property
    def shoulder_after_elbow(self) -> float:
        """How far joint 1 still went after joint 2 had met its stop [rad]; 0 where it was there first."""
        return float(max(0.0, self.stops[1, 0] - self.stops[0, 0]))

    @property
    def elbow_left(self) -> float:
        """How far joint 2 had left its stop when it was registered [rad]."""
        return float(self.stops[1, 1] - self.registered[1])


def home_watched(plant: CablePlant) -> Seek:
    """Home a robot from where it stands, and watch how its positioning joints meet their stops."""
    plant.state_command("enable")
    plant.state_command("home")
    stops = np.full((N, N), np.nan)
    q: list[Floats] = []
    for seek in _ticks(plant):
        if seek.any():
            q.append(plant.state.q.copy())
        for j in np.flatnonzero((seek == STOP_FOUND) & np.isnan(stops[:, 0])):
            stops[j] = plant.state.q
    time = TRACE_TICKS * plant.period * np.arange(len(q[::TRACE_TICKS]), dtype=np.float64)
    return Seek(stops, q[-1], time, np.array(q[::TRACE_TICKS]))


def _ticks(plant: CablePlant) -> Iterator[Floats]:
    while plant.operating_state().is_busy:
        plant.wait()
        yield np.asarray(plant.control.seek[:N])


def shift_of(firmware: Firmware, offsets: Floats) -> Floats:
    """Return by how much encoder offsets (..., 3) [counts] shift the reported joints (..., 3) [rad, rad, m].

    Its zero is anywhere: only differences between registrations of one robot, switched on once, have a meaning.
    """
    winding = -offsets / COUNTS_PER_RADIAN / firmware.ratio[:N]
    return np.stack(joints_of(firmware.coupling, (winding[..., 0], winding[..., 1], winding[..., 2])), axis=-1)


def registration(plant: CablePlant) -> Floats:
    """Return the shift of a robot's reported joints by its encoder offsets as they are now (3,) [rad, rad, m]."""
    return shift_of(plant.firmware, np.asarray(plant.telemetry()["encoffsets"])[:N])


def carried_back(log: MotionLog, firmware: Firmware, to: Floats) -> MotionLog:
    """Return a recording as it would have been under another `registration`, (3,) [rad, rad, m]."""
    shifts = shift_of(firmware, np.column_stack([log.signals[name] for name in OFFSETS]))
    return replace(log, q_nominal=log.q_nominal - shifts + to)


@run(revision=2)
def registrations(seed: int | None, poses: int) -> Result:
    """Home from drawn poses; return what became of joint 2 in each homing, and two homings in full.

    Returns:
        `coupling_error` [deg/deg], and for every homing `travel` of joint 1 after joint 2 met its stop [deg], the
        `shift` of joint 2's registration against a homing from the home pose, and how far joint 2 had `left` its stop
        [deg]. `traces` from the home pose and from the box's corner: time [s], joint 2 against where it met its stop
        [deg], and when joint 1 met its own [s].
    """
    plant = homed(seed)
    traces = {}
    for name, pose in (("home pose", HOME_POSE), ("corner of the box", ELBOW_FIRST)):
        move_to(plant, pose, joints=AXES)
        traces[name] = _trace(home_watched(plant))
    move_to(plant, HOME_POSE, joints=AXES)
    plant.home()
    usual = registration(plant)
    rng = draws(seed, 30)
    travel, shift, moved = [], [], []
    for _ in range(poses):
        move_to(plant, rng.uniform(CALIBRATION_LOWER, CALIBRATION_UPPER), joints=AXES)
        seek = home_watched(plant)
        travel.append(_deg(seek.shoulder_after_elbow))
        moved.append(_deg(seek.elbow_left))
        shift.append(_deg(registration(plant)[1] - usual[1]))
    error = plant.firmware.coupling[0] - plant.cable.coupling[0]
    return {"coupling_error": float(error), "travel": travel, "shift": shift, "left": moved, "traces": traces}


def _deg(angle: float) -> float:
    return round(float(np.rad2deg(angle)), 5)


def _trace(seek: Seek) -> Result:
    stop = seek.stops[1, 1]
    shoulder = int(np.argmax(seek.q[:, 0] <= seek.stops[0, 0] + 1e-4))
    return {
        "time": [round(float(t), 3) for t in seek.time],
        "true": [_deg(q - stop) for q in seek.q[:, 1]],
        "shoulder_s": round(float(seek.time[shoulder]), 3),
    }
