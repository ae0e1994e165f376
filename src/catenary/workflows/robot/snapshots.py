"""A robot or a recording as a stream of samples to look at."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.crtk.message_values import joint_values
from catenary.crtk.reader import CrtkReader
from catenary.crtk.topic_names import JOINT_STATE, calibrated_namespace
from catenary.crtk.transport import Latest
from catenary.errors import TransportError
from catenary.monitor import EventRate, Snapshot
from catenary.plant import JointState, MotionLog, fault_of, joint_indices
from catenary.raven2.transmission import CALIBRATED
from catenary.workflows.robot.operated_robot import OperatedRobot

PERIOD_S = 0.04  # [s] between two samples: 25 a second
_FIRST_STATE_S = 5.0  # [s] for the first one to be heard in time, while the machine is busy with starting


class Corrected(NamedTuple):
    """Outputs of a model for a state; None if unknown."""

    q: Floats | None = None  # (n,) [rad|m]
    inside: Flags | None = None  # (n,) in the valid range
    interval: Floats | None = None  # (n,) half-width about q [rad|m]


class _Calibrated:
    def __init__(self, model: CalibrationModel, names: tuple[str, ...], units: tuple[str, ...], rate_hz: float) -> None:
        self._corrector = Corrector(model, rate_hz=rate_hz)
        self._corrector.prepare(names, units, rate_hz)
        self._q: Floats = np.full(len(names), np.nan)
        self._inside: Flags = np.zeros(len(names), dtype=bool)
        self._interval: Floats = np.full(len(names), np.nan)

    def take(self, state: JointState) -> None:
        self._corrector.correct_state(state, self._q, self._inside, self._interval)

    def latest(self) -> Corrected:
        return Corrected(self._q.copy(), self._inside.copy(), self._interval.copy())


class _Deployed:
    """Reads what `catenary deploy` publishes beside a robot, where it runs."""

    def __init__(self, client: CrtkReader) -> None:
        place = calibrated_namespace(client.arm, client.namespace)
        self._names, self._patience = client.joint_names, client.stale_after
        # models of a RAVEN-II are of its positioning joints, those of a PSM of all
        is_raven = set(CALIBRATED) <= set(self._names)
        self._judged = len(CALIBRATED) if is_raven else len(self._names)
        self._positions = Latest(client.transport, f"{place}/measured_js", JOINT_STATE)
        self._valid = Latest(client.transport, f"{place}/is_valid", "std_msgs/Bool")
        self._intervals = Latest(client.transport, f"{place}/interval", JOINT_STATE)

    def latest(self) -> Corrected:
        """Return calibrated joints, NaN once nothing comes any more, and which are trusted; None before any came."""
        if self._positions.message() is None:
            return Corrected()
        inside: Flags = np.ones(len(self._names), dtype=bool)
        if (message := self._positions.fresh(self._patience)) is None:
            return Corrected(np.full(len(self._names), np.nan), inside)
        valid, intervals = self._valid.message(), self._intervals.fresh(self._patience)
        # the topic tells of the model's joints together
        inside[: self._judged] = valid is None or bool(valid.data)
        q, interval = np.array(joint_values(message, self._names)), None
        if intervals is not None:
            widths = dict(zip(intervals.name, intervals.position, strict=False))
            interval = np.array([widths.get(name, np.nan) for name in self._names], dtype=float)
        return Corrected(q, inside, interval)


def watch_robot(
    robot: OperatedRobot,
    *,
    model: CalibrationModel | None = None,
    every: float = PERIOD_S,
    tick: Callable[[], object] = lambda: None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Snapshot]:
    """Yield snapshots of a robot, which is only read.

    Args:
        every: Period [s].
        tick: Called after each tick of the robot's.
        clock: Time [s].
    """
    plant = robot.plant
    corrected: _Calibrated | _Deployed | None = None
    if model is not None:
        corrected = _Calibrated(model, plant.joint_names, plant.joint_units, 1.0 / plant.period)
    elif isinstance(plant, CrtkReader):
        corrected = _Deployed(plant)
    states, late = EventRate(), EventRate()
    prepared, patience = False, clock() + _FIRST_STATE_S
    seen_late, last, next_sample = robot.late(), None, clock()
    state: JointState | None = None
    while True:
        silent = None
        try:
            plant.wait()
            state = plant.measured_js()
            setpoint: Floats | None = plant.setpoint_js().q
            if setpoint is not None and np.isnan(setpoint).all():
                setpoint = None  # nothing was heard of it
            operating = plant.operating_state()
        except TransportError as error:
            silent = str(error)
            if state is None:
                if clock() > patience:
                    raise
                continue
        if not prepared:
            robot.gravity_torque(state)
            _truth(robot, state.q, None)
            prepared, seen_late, next_sample = True, robot.late(), clock()
            continue
        tick()
        now = clock()
        if silent is None and state.time != last:
            states.count(now)
            last = state.time
            if isinstance(corrected, _Calibrated):
                corrected.take(state)
        late.count(now, robot.late() - seen_late)
        seen_late = robot.late()
        if now < next_sample:
            continue
        next_sample = now + every
        latest = Corrected() if corrected is None else corrected.latest()
        yield Snapshot(
            state.time, plant.joint_names, plant.joint_units, state.q, setpoint,
            latest.q, latest.inside, latest.interval, tau=state.tau,
            gravity_tau=robot.gravity_torque(state), gravity=state.gravity, gravity_age=state.gravity_age,
            operating=operating, fault=fault_of(plant) if operating.state == "FAULT" else "",
            lower=plant.lower, upper=plant.upper, rate_hz=states.hertz(now),
            late=late.within(now), silent=silent, **_truth(robot, state.q, latest.q),
        )  # fmt: skip


def _truth(robot: OperatedRobot, q: Floats, calibrated: Floats | None) -> dict[str, Any]:
    tip, truth = robot.tip(q), robot.truth()
    if truth is None:
        return {"tip": tip}
    known: dict[str, Any] = {
        "tip": tip, "error": q[: len(truth.q)] - truth.q, "tip_error": math.dist(tip, robot.tip(truth.q)),
    }  # fmt: skip
    if truth.encoders is not None:
        seen = robot.tip(truth.encoders)
        known |= {"encoder": truth.encoders, "tip_from_encoders": math.dist(tip, seen)}
        if calibrated is not None:
            known["calibrated_from_encoders"] = math.dist(robot.tip(calibrated), seen)
    return known


def corrected_rows(log: MotionLog, model: CalibrationModel) -> Corrected:
    """Return a recording's positions corrected by a model; joints that it does not cover stay as reported.

    Args:
        log: The recording of N rows.
    """
    places = joint_indices(model, log, whose=f'recording "{log.name}"', of="the model is for")
    q, interval = np.array(log.q_nominal), np.full(log.q_nominal.shape, np.nan)
    inside = np.ones(q.shape, dtype=bool)
    features, leaping, *_ = model.features.rows(log)
    correction, inside[:, places], interval[:, places] = model.correct(features, q[:, places], leaping)
    q[:, places] += correction
    return Corrected(q, inside, interval)
