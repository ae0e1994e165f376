"""Base class of simulated arms with their own firmware: compiled runs, homing, control modes, saved states."""

import json
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.archives import read_arrays
from catenary.arrays import Floats, as_array
from catenary.bounded_parsers import cut, json_table, shortened
from catenary.errors import FileFormatError, InputError, NotReadyError
from catenary.files import written_whole
from catenary.plant import Column, JointState
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, FixedBase, MovingBase, imu_reading
from catenary.simulation.cable_physics import ArmState
from catenary.simulation.compiled_records import AXES, OFF, POSITION, POSITIONING, TORQUE, Record
from catenary.simulation.firmware import AxisLog
from catenary.simulation.simulated_plant import PERIOD, SimulatedPlant
from catenary.transmission.cable_elasticity import RANDOM_MODULUS

Log = TypeVar("Log", bound=AxisLog)
AXIS_FIELDS = {  # name in telemetry: field of the firmware's state, unit
    "encVals": ("counts", "counts"),
    "mpos": ("motor", "rad"),
    "mvel": ("motor_velocity", "rad/s"),
    "jpos": ("joint", "rad|m"),
    "jvel": ("joint_velocity", "rad/s|m/s"),
    "jpos_d": ("setpoint", "rad|m"),
}


class FirmwarePlant(SimulatedPlant, Generic[Log]):
    """Cable-driven arm with its firmware; a subclass provides the parameters, the compiled ticks and the homing.

    It must be homed and enabled to move; brakes hold it while it is not enabled. `state` is that of the arm, `control`
    that of its firmware; a subclass creates both.
    """

    supports = SimulatedPlant.supports | {"servo_jf_of"}
    state: ArmState
    firmware: Any  # subclass of AxisFirmware
    control: Any  # subclass of AxisControl
    log: type[Log]  # of the ticks of a run
    reported: Mapping[str, tuple[str, str]]  # column of telemetry: field of `control`, unit
    stops_when: str  # message of the firmware's own stop, with {time}
    _homing: Iterator[Floats] | None = None

    def __init__(self, base: MovingBase | None, substeps: int) -> None:
        """Set the base, level and fixed when None, and the physics steps per tick of 1 ms, at least 1."""
        if substeps < 1:
            raise InputError(f"substeps: expected at least 1, got {substeps}")
        super().__init__(BaseTimeline(FixedBase() if base is None else base, PERIOD), is_homed=False)
        self.substeps = substeps

    @property
    def lower(self) -> Floats:
        """Lower limits of the setpoints, (n,) [rad|m]."""
        return np.array(self.firmware.lower)

    @property
    def upper(self) -> Floats:
        """Upper limits of the setpoints, (n,) [rad|m]."""
        return np.array(self.firmware.upper)

    def measured_js(self) -> JointState:
        """Return the joint state that the firmware reports, with gravity and base rates of an ideal sensor."""
        own = self.control.copy()
        return self._joint_state(own.joint, own.joint_velocity, self._joint_torques(), own.motor)

    def setpoint_js(self) -> JointState:
        """Return the firmware's joint setpoint."""
        setpoint = self.control.setpoint.copy()
        return self.measured_js()._replace(q=setpoint, qd=np.zeros(len(setpoint)))

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques, (n,), or (3,) for the positioning joints with the tool held [Nm, Nm, N, Nm...].

        They act until the next command; the setpoint follows the arm meanwhile.
        """
        self._require_ready()
        n = POSITIONING if np.shape(tau) == (POSITIONING,) else len(self.joint_names)
        torque = as_array("servo_jf", tau, (n,))
        self.control.torque_command[:n] = torque
        self.control.mode[:n] = TORQUE
        self.control.mode[n:] = POSITION

    def servo_jf_of(self, tau: Floats, pushed: NDArray[np.bool_]) -> None:
        """Command torques (n,) [Nm, Nm, N, Nm...] of the joints in `pushed` (n,); the others hold their setpoint."""
        self._require_ready()
        n = len(self.joint_names)
        self.control.torque_command[:] = as_array("servo_jf_of", np.where(pushed, tau, 0.0), (n,))
        self.control.mode[:] = np.where(pushed, TORQUE, POSITION)

    def wait(self) -> None:
        """Advance by one tick of 1 ms."""
        row = self._target if self._homing is None else self._next_homing_row(self._homing)
        rows = np.full((1, len(self.joint_names)), np.nan) if row is None else row[np.newaxis]  # NaN: no motion
        self._advance(rows, self.log.rows(0))
        self._target = None

    def run(self, setpoints: ArrayLike) -> Log:
        """Run setpoints (T, n) [rad|m], one a tick, in one compiled call; return their log. NaN leaves an axis.

        The result equals that of `servo_jp` and `wait` for every row, sample for sample. Split hours into pieces: a log
        takes some 500 B a tick.

        Raises:
            NotReadyError: The robot is not ready, or its firmware stopped during the run.
        """
        self._require_ready()
        rows = as_array("run: setpoints", setpoints, (None, len(self.joint_names)), finite=False)
        if np.isinf(rows).any():
            raise InputError(f"run: setpoints are infinite on {np.isinf(rows).any(axis=1).sum()} rows")
        self.control.mode[:] = POSITION
        log = self.log.rows(len(rows))
        self._advance(rows, log)
        if self._state == "FAULT":
            raise NotReadyError(self._fault)
        return log

    def resume_at(self, tick: int, registered: Mapping[str, Floats], *, is_homed: bool) -> None:
        """Resume from a saved tick, disabled; `state` and `control` must be restored before."""
        self._tick = tick
        self._is_homed = is_homed
        self._set_state("DISABLED")

    # for subclasses

    @property
    @abstractmethod
    def identity(self) -> dict[str, object]:
        """Parameters that distinguish this arm from others of its kind."""

    @property
    def registered(self) -> dict[str, Floats]:
        """Arrays that homing wrote besides `control`, by name."""
        return {}

    @abstractmethod
    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""

    def _sample(self, **further: Floats) -> dict[str, Floats]:
        """Return copies of the present values of `columns_of`; the base's sensor is at its origin."""
        own = self.control.copy().view(np.ndarray)
        specific_force, rate = imu_reading(self._base_now())
        columns = {name: own[field] for name, (field, _) in self.reported.items()}
        return {**columns, **further, "accelerometer": specific_force[0], "gyroscope": rate[0].copy()}

    @abstractmethod
    def external_encoders(self) -> Floats:
        """Return joint positions by external encoders or a tracker [rad|m]; NaN before they are registered."""

    def _joint_torques(self) -> Floats:  # (n,) [Nm|N], as the robot reports them
        return np.array(self.control.torque)

    @abstractmethod
    def _run_ticks(self, rows: Floats, base: BaseSamples, log: Log) -> int:
        """Run a tick for each row (T, n) in compiled code; return the number of ticks before a stop."""

    @abstractmethod
    def _homing_rows(self) -> Iterator[Floats]:
        """Home tick by tick: yield the next setpoints (n,)."""

    def _state_or_homing_changed(self) -> None:
        """Update settings that depend on state and homing; also called when homing ends in any way."""

    # for all arms

    def _wake_encoders(self, rng: np.random.Generator, max_offset: float, read: Callable[[], None]) -> None:
        """Power on the encoders with random offsets up to `max_offset` counts; set the setpoint to their reading."""
        control = self.control
        control.offset = np.round(rng.uniform(-max_offset, max_offset, AXES))
        read()
        control.motor_velocity[:] = 0.0
        control.joint_velocity[:] = 0.0
        control.setpoint = control.joint
        self.state.dice = np.floor(rng.uniform(1.0, RANDOM_MODULUS, len(self.state.q)))

    def _advance(self, rows: Floats, log: Log) -> None:
        """Run a tick for each row (T, n), until the firmware stops itself."""
        done = 0
        while done < len(rows) and not (done and self.control.stopped):
            base, count = self._base.rows(self._tick, len(rows) - done)
            ran = self._run_ticks(rows[done : done + count], base, log[done:])
            done, self._tick = done + ran, self._tick + ran
        if self.control.stopped:
            self._set_state("FAULT", self.stops_when.format(time=f"{self.time:.3f} s"))

    def _next_homing_row(self, homing: Iterator[Floats]) -> Floats | None:
        try:
            row = next(homing, None)
        except NotReadyError as error:
            self._set_state("FAULT", str(error))
            raise
        if row is None:  # the setpoint stays at home
            self._stop_homing()
            self._is_homed = True
            self._state_or_homing_changed()
        return row

    @property
    def _is_homing(self) -> bool:
        return self._homing is not None

    def _begin_homing(self) -> None:
        self._stop_homing()
        self._is_homed = False
        self._state_or_homing_changed()
        self.control.braked = False
        self._homing = self._homing_rows()

    def _stop_homing(self) -> None:
        self._homing = None
        self.control.guarded = True

    def _unhomed(self) -> None:
        """Keep the firmware running; only servo commands are refused."""

    def _control_position(self) -> None:
        self.control.mode[:] = POSITION

    def _state_changed(self) -> None:
        self._stop_homing()
        control, moves = self.control, self._moves
        if self._state == "ENABLED":
            control.stopped = False
        control.braked = not moves
        control.mode[:] = POSITION if moves else OFF
        if moves:  # no jump when control begins
            control.setpoint = control.joint
        self._state_or_homing_changed()


def columns_of(reported: Mapping[str, tuple[str, str]], *further: Column) -> tuple[Column, ...]:
    """Return the columns of a telemetry: those of the axes, further ones, and those of an IMU on the base."""
    axes = (Column(name, unit, AXES) for name, (_, unit) in reported.items())
    return (*axes, *further, Column("accelerometer", "m/s2", 3), Column("gyroscope", "rad/s", 3))


def half_cosine(start: Floats, goal: Floats, seconds: float) -> Iterator[Floats]:
    """Yield setpoints from start to goal along half a cosine, one a tick."""
    ticks = round(seconds / PERIOD)
    for k in range(1, ticks + 1):
        yield start + (goal - start) * 0.5 * (1.0 - np.cos(np.pi * k / ticks))


STATE_FORMAT = "catenary.cable_plant.1"
_MAX_MAGNITUDE = 1e10  # of all saved numbers: counts, random numbers, radians, metres, newtons, newton metres
_UNSAVED_FIELD = "gravity_torque"  # of the firmware: zero while disabled
AnyArm = FirmwarePlant[Any]


def save_plant(plant: AnyArm, path: Path) -> None:
    """Save the state of an arm and its firmware as a NumPy archive, without its parameters, which follow from its seed.

    Args:
        path: File to replace atomically.
    """
    arrays = {key: record[name] for key, record, name in _saved(plant)} | plant.registered
    about = _robot(plant) | {"tick": plant.ticks, "is_homed": plant.operating_state().is_homed}
    with written_whole(path) as file:
        np.savez(file, about=np.array(json.dumps(about)), **arrays)


def restore_plant(plant: AnyArm, path: Path) -> None:
    """Restore the state that `save_plant` wrote; the arm is disabled.

    Args:
        plant: Arm with the same parameters and base.
    """
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file; no state of the robot was saved there")
    expected = _robot(plant)
    try:
        arrays = read_arrays(path)
        about = json_table(str(arrays["about"]), f"{path}: about")
        saved = {key: about[key] for key in expected}
    except (FileFormatError, KeyError) as error:
        raise _unreadable(path, error) from error
    if saved != expected:
        raise FileFormatError(f"{path}: is of another robot: {cut(str(saved))}, expected {expected}")
    try:
        values = [_like(arrays[key], record[name], name) for key, record, name in _saved(plant)]
        registered = {name: _like(arrays[name], now, name) for name, now in plant.registered.items()}
        tick, is_homed = about.get("tick"), about.get("is_homed")
        if type(tick) is not int or not 0 <= tick < 2**53 or not isinstance(is_homed, bool):
            raise ValueError(f"tick {shortened(tick)}, is_homed {shortened(is_homed)}")
    except (KeyError, ValueError) as error:
        raise _unreadable(path, error) from error
    for value, (_, record, name) in zip(values, _saved(plant), strict=True):
        record[name] = value
    plant.resume_at(tick, registered, is_homed=is_homed)


def _saved(plant: AnyArm) -> list[tuple[str, Record, str]]:
    """Return the saved quantities of an arm: name in the file, record and field."""
    records = {"arm": plant.state, "control": plant.control}
    return [
        (f"{part}.{name}", record, name)
        for part, record in records.items()
        for name in record.fields
        if name != _UNSAVED_FIELD
    ]


def _unreadable(path: Path, error: Exception) -> FileFormatError:
    why = str(error).removeprefix(f"{path}: ") if isinstance(error, FileFormatError) else cut(repr(error))
    return FileFormatError(
        f"{path}: is no state of a simulated robot that this version reads ({why}); if another version "
        "saved it, home again: `catenary home PROJECT`"
    )


def _like(values: NDArray[Any], now: Any, name: str) -> NDArray[Any]:
    """Check that values have the shape of the present ones, NaN only where these have, and plausible magnitudes."""
    if values.dtype.kind not in "biuf" or values.shape != np.shape(now):
        raise ValueError(f"{name}: {values.dtype} of shape {values.shape}, expected numbers of {np.shape(now)}")
    is_right = np.abs(values) < _MAX_MAGNITUDE
    if np.asarray(now).dtype.kind == "f":
        is_right |= np.isnan(values) & np.isnan(now)
    if not is_right.all():
        raise ValueError(f"{name}: {cut(str(values))}, expected numbers below {_MAX_MAGNITUDE:g}")
    return values


def _robot(plant: AnyArm) -> dict[str, object]:
    return {"format": STATE_FORMAT, **plant.identity, "base": repr(plant.base)}
