"""What simulated arms share whose own firmware runs within the physics' ticks: runs, homing, modes, saved states."""

import json
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.archives import read_arrays
from catenary.arrays import Floats, as_array
from catenary.documents import cut, json_table, shortened
from catenary.errors import FileFormatError, InputError, NotReadyError
from catenary.files import written_whole
from catenary.plant import Column, JointState
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, FixedBase, MovingBase, imu_reading
from catenary.simulation.cable_physics import ArmState
from catenary.simulation.firmware import AxisLog
from catenary.simulation.records import AXES, OFF, POSITION, POSITIONING, TORQUE, Record
from catenary.simulation.simulated_plant import PERIOD, SimulatedPlant
from catenary.transmission.cable_elasticity import SPREAD

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
    """An arm behind cables with its firmware; a subclass has the numbers, the compiled ticks and the way to home.

    Nothing moves before it is homed and enabled; brakes hold it while it is not enabled. `state` is what the arm does,
    `control` what its firmware knows; a subclass makes both.
    """

    supports = SimulatedPlant.supports | {"servo_jf_of"}
    state: ArmState
    firmware: Any  # an AxisFirmware with more
    control: Any  # an AxisControl with more
    log: type[Log]  # what a run keeps of each tick
    reported: Mapping[str, tuple[str, str]]  # column of telemetry: field of `control`, unit
    stops_when: str  # why the firmware stops by itself, in words
    _homing: Iterator[Floats] | None = None

    def __init__(self, base: MovingBase | None, substeps: int) -> None:
        """Stand on a base, a level one at rest when None, with so many physics steps in a tick of 1 ms."""
        if substeps < 1:
            raise InputError(f"substeps: expected at least 1, got {substeps}")
        super().__init__(BaseTimeline(FixedBase() if base is None else base, PERIOD), is_homed=False)
        self.substeps = substeps

    @property
    def lower(self) -> Floats:
        """Limits below of the setpoints, (n,) [rad|m]."""
        return np.array(self.firmware.lower)

    @property
    def upper(self) -> Floats:
        """Limits above, (n,)."""
        return np.array(self.firmware.upper)

    def measured_js(self) -> JointState:
        """Return the joint state that the firmware believes; gravity and base rates are an ideal sensor's."""
        own = self.control.copy()
        return self._joint_state(own.joint, own.joint_velocity, self._joint_torques(), own.motor)

    def setpoint_js(self) -> JointState:
        """Return the firmware's joint setpoint."""
        setpoint = self.control.setpoint.copy()
        return self.measured_js()._replace(q=setpoint, qd=np.zeros(len(setpoint)))

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques, (n,), or (3,) for the positioning joints with the tool held [Nm, Nm, N, Nm...].

        They hold until the next command, and the setpoint follows the arm meanwhile.
        """
        self._require_ready()
        n = POSITIONING if np.shape(tau) == (POSITIONING,) else len(self.joint_names)
        torque = as_array("servo_jf", tau, (n,))
        self.control.torque_command[:n] = torque
        self.control.mode[:n] = TORQUE
        self.control.mode[n:] = POSITION

    def servo_jf_of(self, tau: Floats, pushed: NDArray[np.bool_]) -> None:
        """Command torques (n,) [Nm, Nm, N, Nm...] of joints that are pushed, (n,); others hold their setpoint."""
        self._require_ready()
        n = len(self.joint_names)
        self.control.torque_command[:] = as_array("servo_jf_of", np.where(pushed, tau, 0.0), (n,))
        self.control.mode[:] = np.where(pushed, TORQUE, POSITION)

    def wait(self) -> None:
        """Advance by one tick of 1 ms."""
        row = self._wanted if self._homing is None else self._next_homing_row(self._homing)
        rows = np.full((1, len(self.joint_names)), np.nan) if row is None else row[np.newaxis]  # NaN: stay
        self._advance(rows, self.log.rows(0))
        self._wanted = None

    def run(self, setpoints: ArrayLike) -> Log:
        """Run a list of setpoints (T, n), one a tick, in one compiled call, with the firmware inside.

        Equal, sample for sample, to `servo_jp` and `wait` for every row. NaN leaves that axis alone. Hours are run in
        pieces: a log takes some 500 B a tick.
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
        """Go on from a saved tick, disabled, as `registered` was; `state` and `control` have been written already."""
        self._tick = tick
        self._is_homed = is_homed
        self._set_state("DISABLED")

    # what a subclass does

    @property
    @abstractmethod
    def identity(self) -> dict[str, object]:
        """What makes this arm another one than others of its kind."""

    @property
    def registered(self) -> dict[str, Floats]:
        """What homing wrote besides `control`."""
        return {}

    @abstractmethod
    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""

    def _sample(self, **further: Floats) -> dict[str, Floats]:
        """Return the columns of `columns_of` at this instant, as copies; the base's sensor is at its origin."""
        own = self.control.copy().view(np.ndarray)
        specific_force, rate = imu_reading(self._base_now())
        columns = {name: own[field] for name, (field, _) in self.reported.items()}
        return {**columns, **further, "accelerometer": specific_force[0], "gyroscope": rate[0].copy()}

    @abstractmethod
    def external_encoders(self) -> Floats:
        """Return where the joints that encoders or a tracker see are seen [rad|m]; NaN before they are registered."""

    def _joint_torques(self) -> Floats:
        """Return the joint torques (n,) that the robot reports [Nm|N]."""
        return np.array(self.control.torque)

    @abstractmethod
    def _run_ticks(self, rows: Floats, base: BaseSamples, log: Log) -> int:
        """Run a tick for each row (T, n) in compiled code; return how many were run before it stopped."""

    @abstractmethod
    def _homing_rows(self) -> Iterator[Floats]:
        """Home, tick by tick: each item is the next row of setpoints (n,)."""

    def _state_or_homing_changed(self) -> None:
        """Do what depends on both; called at the end of a homing, however it ended."""

    # what all of them do

    def _wake_encoders(self, rng: np.random.Generator, most: float, read: Callable[[], None]) -> None:
        """Read the encoders, which count from wherever they woke up, and hold the setpoint there."""
        control = self.control
        control.offset = np.round(rng.uniform(-most, most, AXES))
        read()
        control.motor_velocity[:] = 0.0
        control.joint_velocity[:] = 0.0
        control.setpoint = control.joint
        self.state.dice = np.floor(rng.uniform(1.0, SPREAD, len(self.state.q)))

    def _advance(self, rows: Floats, log: Log) -> None:
        """Run a tick for each row (T, n), until the firmware stops by itself."""
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
        """The firmware goes on; it is the servo verbs that are refused."""

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
    """Return the columns of a telemetry: those of the axes, others, and what a sensor on the base reads."""
    axes = (Column(name, unit, AXES) for name, (_, unit) in reported.items())
    return (*axes, *further, Column("accelerometer", "m/s2", 3), Column("gyroscope", "rad/s", 3))


def half_cosine(start: Floats, goal: Floats, seconds: float) -> Iterator[Floats]:
    """Go from start to goal along half a cosine, tick by tick."""
    ticks = round(seconds / PERIOD)
    for k in range(1, ticks + 1):
        yield start + (goal - start) * 0.5 * (1.0 - np.cos(np.pi * k / ticks))


STATE_FORMAT = "catenary.cable_plant.1"
_MAX_MAGNITUDE = 1e10  # of counts, random numbers, radians, metres, newtons and newton metres in an arm
_UNSAVED_FIELD = "gravity_torque"  # of the firmware: zero while disabled
AnyArm = FirmwarePlant[Any]


def save_plant(plant: AnyArm, path: Path) -> None:
    """Write where an arm stands and what its firmware knows; not its parameters, which follow from its seed."""
    arrays = {key: record[name] for key, record, name in _saved(plant)} | plant.registered
    about = _robot(plant) | {"tick": plant.ticks, "is_homed": plant.operating_state().is_homed}
    with written_whole(path) as file:
        np.savez(file, about=np.array(json.dumps(about)), **arrays)


def restore_plant(plant: AnyArm, path: Path) -> None:
    """Put an arm back where `save_plant` left it, disabled."""
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file; no state of the robot was saved there")
    wanted = _robot(plant)
    try:
        arrays = read_arrays(path)
        about = json_table(str(arrays["about"]), f"{path}: about")
        found = {key: about[key] for key in wanted}
    except (FileFormatError, KeyError) as error:
        raise _unreadable(path, error) from error
    if found != wanted:
        raise FileFormatError(f"{path}: is of another robot: {cut(str(found))}, expected {wanted}")
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
    """Return what is saved of an arm: its name in the file, its record and its field there."""
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
    """Return values of the shape of those of now, NaN only where these are, no larger than anything in an arm."""
    if values.dtype.kind not in "biuf" or values.shape != np.shape(now):
        raise ValueError(f"{name}: {values.dtype} of shape {values.shape}, expected numbers of {np.shape(now)}")
    is_right = np.abs(values) < _MAX_MAGNITUDE
    if np.asarray(now).dtype.kind == "f":
        is_right |= np.isnan(values) & np.isnan(now)
    if not is_right.all():
        raise ValueError(f"{name}: {cut(str(values))}, expected numbers below {_MAX_MAGNITUDE:g}")
    return values


def _robot(plant: AnyArm) -> dict[str, object]:
    """Return everything that makes an arm another one, or makes it stand elsewhere."""
    return {"format": STATE_FORMAT, **plant.identity, "base": repr(plant.base)}
