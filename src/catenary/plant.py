"""Robot interface (`Plant`: CRTK commands, operating states, joint states) and recordings (`MotionLog`)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, frozen, without_missing
from catenary.errors import InputError, NotReadyError, UnsupportedCommandError
from catenary.tables import OnScreen, Screen, Table
from catenary.terminal_text import visible
from catenary.units import shown_rows

_JOINT_UNITS = ("rad", "m")
# a gap is a time step longer than so many median steps, and than twice this quantile of steps, so that messages in
# bursts leave no gaps
GAP_STEPS, _GAP_SHARE = 10.0, 0.95
# number of rows that identify a recording, and of consecutive matches needed, as single rows may match by chance
MARKS, _MIN_MARKS = 256, 8
# number of poses that identify a recording at another rate, and tolerance as a share of the range
POSES, _SAME_POSE_SHARE = 64, 0.02
FIRST_DATE_S = 1e9  # [s since 1970] a clock below this does not show the date
_HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # odd and without pattern, so that similar rows have different hashes
UNUSED_CHANNEL = "unused"  # fourth of eight channels of a RAVEN-II's arm, which drives nothing
StateName = Literal["DISABLED", "ENABLED", "PAUSED", "FAULT"]
StateCommand = Literal["enable", "disable", "pause", "resume", "home", "unhome"]
STATE_COMMANDS: tuple[str, ...] = get_args(StateCommand)
# command: states in which a robot obeys it, each with the one that follows; home and unhome change is_homed only
TRANSITIONS: Mapping[StateCommand, Mapping[StateName, StateName]] = {
    "enable": {"DISABLED": "ENABLED", "FAULT": "ENABLED"},
    "disable": {"DISABLED": "DISABLED", "ENABLED": "DISABLED", "PAUSED": "DISABLED", "FAULT": "DISABLED"},
    "pause": {"ENABLED": "PAUSED"},
    "resume": {"PAUSED": "ENABLED"},
    "home": {"ENABLED": "ENABLED"},
    "unhome": {state: state for state in get_args(StateName)},
}
AT_REST = frozen(np.zeros((2, 3)))  # base_rates of a base that is fixed, or whose motion is not measured

_NO_INTERVAL = frozen(np.zeros(0))  # q_interval of a state without corrected positions


class OperatingState(NamedTuple):
    """CRTK's operating state."""

    state: StateName
    is_homed: bool
    is_busy: bool

    @property
    def is_ready(self) -> bool:
        """Whether a robot obeys motion commands."""
        return self.state == "ENABLED" and self.is_homed and not self.is_busy


class JointState(NamedTuple):
    """State of a robot at one instant; the receiver owns the arrays.

    Examples:
        >>> plant = catenary.MujocoPlant(catenary.load_robot("two_link"), start=[0.3, 0.5])
        >>> state = plant.measured_js()
        >>> state.q, state.gravity
        (array([0.3, 0.5]), array([ 0.  ,  0.  , -9.81]))
    """

    time: float  # [s]
    q: Floats  # (n,) [rad|m] q_nominal as measured, q_calibrated after a corrector
    qd: Floats  # (n,) [rad/s|m/s]
    tau: Floats  # (n,) [Nm|N] commanded joint torque
    q_motor: Floats  # (m,) [rad] motor shafts, empty if a robot has none
    gravity: Floats  # (3,) [m/s2] in the base frame: free-fall acceleration less that of the base's origin
    gravity_age: float  # [s] since it was measured; inf if it is nominal
    # (2, 3) angular velocity and acceleration of the base, in its axes [rad/s, rad/s2]
    base_rates: Floats = AT_REST
    # (n,) half-width of an interval about q_calibrated [rad|m], NaN for a joint without one; empty without corrector
    q_interval: Floats = _NO_INTERVAL


class Column(NamedTuple):
    """One declared quantity of a robot's telemetry."""

    name: str
    unit: str
    width: int  # numbers per sample


class Jointed(Protocol):
    """Anything whose joints have names and units: a recording, a robot, a calibration model."""

    @property
    def joint_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def joint_units(self) -> tuple[str, ...]: ...  # noqa: D102


class Bounded(Jointed, Protocol):
    """Anything with joint limits: a plant or a robot model."""

    @property
    def lower(self) -> Floats: ...  # noqa: D102
    @property
    def upper(self) -> Floats: ...  # noqa: D102


class Plant(Bounded, Protocol):
    """A robot, real or simulated, with CRTK's commands.

    A robot has the commands in `supports`; others raise UnsupportedCommandError. Only a robot that is enabled and homed
    moves; otherwise the servo commands raise NotReadyError.
    """

    @property
    def period(self) -> float: ...  # noqa: D102  [s] of a tick
    @property
    def simulated(self) -> bool: ...  # noqa: D102
    @property
    def supports(self) -> frozenset[str]: ...  # noqa: D102
    @property
    def columns(self) -> tuple[Column, ...]: ...  # noqa: D102  of telemetry

    def measured_js(self) -> JointState:
        """Return the latest measured joint state."""

    def setpoint_js(self) -> JointState:
        """Return the latest joint setpoint."""

    def servo_jp(self, q: Floats) -> None:
        """Command joint positions (n,) [rad|m] for the next tick."""

    def servo_jr(self, dq: Floats) -> None:
        """Command joint increments (n,) [rad|m] for the next tick."""

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques (n,) [Nm|N], in place of the robot's own position control."""

    def operating_state(self) -> OperatingState:
        """Return the operating state."""

    def state_command(self, command: StateCommand) -> None:
        """Request a transition of the operating state; the robot decides."""

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every declared column, each (width,)."""

    def wait(self) -> None:
        """End a tick: a simulator advances by its period, hardware sleeps until the next one."""


def fault_of(plant: Plant) -> str:
    """Return the robot's reason for FAULT; empty if it reports none."""
    return str(getattr(plant, "fault_reason", ""))


def state_in_words(plant: Plant, state: OperatingState) -> str:
    """Return the name of a robot's operating state, FAULT with the robot's reason if any.

    Args:
        plant, state: The robot, and its state.
    """
    why = fault_of(plant) if state.state == "FAULT" else ""
    return f"FAULT ({why})" if why else state.state


# instructions by operating state
_WAYS_TO_ENABLED = {
    "PAUSED": ". Its pedal resumes it, or the state command resume (R in catenary teleop)",
    "DISABLED": ". Its start button enables it, or the state command enable (E in catenary teleop)",
    "FAULT": ". Remove the cause, then enable it again",
}


def require_ready(plant: Plant, verb: str) -> None:
    """Refuse to move a robot that is not enabled, not homed or busy, or lacks the command.

    Args:
        plant, verb: The robot, and the CRTK command that would move it: "servo_jp", "move_jp".
    """
    if verb not in plant.supports:
        raise UnsupportedCommandError(
            f"the robot has no {verb}, which this motion needs; it has {', '.join(sorted(plant.supports))}"
        )
    state = plant.operating_state()
    if state.state != "ENABLED":
        raise NotReadyError(
            f"the robot is {state_in_words(plant, state)}, expected ENABLED; nothing has moved"
            f"{_WAYS_TO_ENABLED.get(state.state, '')}"
        )
    if not state.is_homed:
        raise NotReadyError("the robot is not homed: its joint positions mean nothing yet; nothing has moved")
    if state.is_busy:
        raise NotReadyError("the robot is busy with its own motion; nothing has moved")


class Joints(NamedTuple):
    """Names and units of joints, in order; units are empty if unknown."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...] = ()


class JointRanges(NamedTuple):
    """Joints, in order, and their ranges of motion."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # rad or m
    lower: Floats  # (n,) [rad|m]
    upper: Floats  # (n,)


def joints_text(joints: Jointed) -> str:
    """Return joints and their units as text for messages."""
    units = [f" [{unit}]" if unit else "" for unit in joints.joint_units] or [""] * len(joints.joint_names)
    return ", ".join(map("".join, zip(joints.joint_names, units, strict=True)))


def nameless(count: int) -> tuple[str, ...]:
    """Return J1, J2, ..., the names of joints without names in a file."""
    return tuple(f"J{i + 1}" for i in range(count))


def joint_indices(target: Jointed, available: Jointed, *, whose: str, of: str) -> NDArray[np.int64]:
    """Return the index (n,) of each target joint among those of a robot, recording or model, matched by name.

    Units are compared if both sides have them.

    Args:
        target, available: Joints (names, units) to find, and those to search, which may be more.
        whose, of: Owner of each for messages: 'recording "run"' has, "the model is for" wants.
    """
    names = available.joint_names
    both = f"it has {joints_text(available)}, {of} {joints_text(target)}"
    for name in target.joint_names:
        if name not in names:
            like = [other for other in names if other.endswith(name) or name.endswith(other)]
            hint = f'; is "{like[0]}" meant? Names must be the same' if len(like) == 1 else ""
            raise InputError(f'{whose} has no joint "{name}"; {both}{hint}')
    places = [names.index(name) for name in target.joint_names]
    for name, unit, k in zip(target.joint_names, target.joint_units, places, strict=False):
        if unit and available.joint_units and available.joint_units[k] != unit:
            raise InputError(f'{whose} has joint "{name}" in {available.joint_units[k]}, not {unit}; {both}')
    return np.array(places, dtype=np.int64)


JOINT_ARRAYS = ("q_nominal", "q_reported", "q_encoder", "qd", "tau")  # of a log, (N, n)


@dataclass(frozen=True, repr=False)
class MotionLog(OnScreen):
    """Rows of one or more recordings of the same robot, in the order in which they were taken.

    Joint arrays are (N, n) in the joints' units. `q_nominal` are reported or commanded positions, computed for rigid
    cables; `q_encoder` are true positions, valid on rows where `ok` is set.

    Examples:
        >>> log = catenary.MotionLog("run", ("J1",), ("rad",), q_nominal=np.zeros((3, 1)), ok=np.ones(3, bool))
        >>> len(log)
        3
    """

    name: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    q_nominal: Floats  # (N, n)
    ok: NDArray[np.bool_]  # (N,) rows whose q_encoder can be trusted
    q_encoder: Floats | None = None  # (N, n)
    time: Floats | None = None  # (N,) [s]
    # [s] reading of the recording's own clock at time zero: since 1970 if it shows the date
    began: float = 0.0
    qd: Floats | None = None  # (N, n) [rad/s or m/s]
    tau: Floats | None = None  # (N, n) [Nm or N]
    signals: Mapping[str, Floats] = field(default_factory=dict)  # other columns, each (N,)
    signal_units: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    simulated: bool = False
    sha256: str | None = None  # of the file that it was read from
    units_assumed: bool = False  # units were stated neither in the file nor by options
    repeated: int = 0  # rows left out by the reader for their repeated time stamps
    # options of corrections, by step and array ("shift", "sign:q_encoder"); empty if stated in the file
    settled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # decisions of the reader
    q_reported: Floats | None = None  # (N, n) reported positions, if q_nominal is a setpoint
    # by quantity, median time from a message's stamp to its arrival, and between messages [s]
    arrivals: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", visible(self.name))  # names of files may hold any bytes
        object.__setattr__(self, "notes", tuple(map(visible, self.notes)))
        rows, n = len(self), len(self.joint_names)
        where = f'recording "{self.name}"'
        if n == 0:
            raise InputError(f"{where}: has no joints, expected at least one")
        if len(set(self.joint_names)) != n:
            raise InputError(f"{where}: joint names must differ, got {list(self.joint_names)}")
        if len(self.joint_units) != n or any(unit not in _JOINT_UNITS for unit in self.joint_units):
            raise InputError(
                f"{where}: expected {n} units, each rad or m, for joints {', '.join(self.joint_names)}; "
                f"got {list(self.joint_units)}"
            )
        if rows == 0:
            raise InputError(f"{where}: is empty, expected at least one row")
        for key in (*JOINT_ARRAYS, "time", "ok"):
            values, shape = getattr(self, key), (rows, n) if key in JOINT_ARRAYS else (rows,)
            if values is None:
                continue
            if values.shape != shape:
                raise InputError(f"{where}: {key}: expected shape {shape}, got {values.shape}")
            # q_encoder may hold any number where ok is not set
            bad = np.zeros(0) if key in ("q_encoder", "ok") else np.argwhere(~np.isfinite(values))
            if len(bad):
                raise InputError(
                    f"{where}: {key} is {values[tuple(bad[0])]} at row {int(bad[0][0])}; expected finite numbers "
                    f"({len(bad)} are not)"
                )
            object.__setattr__(self, key, frozen(values))
        if self.ok.dtype != np.bool_:
            raise InputError(f"{where}: ok: expected true or false on each row, got {self.ok.dtype}")
        for key, values in self.signals.items():
            if values.shape != (rows,):
                raise InputError(f'{where}: signal "{key}": expected shape ({rows},), got {values.shape}')
        object.__setattr__(self, "signals", {key: frozen(values) for key, values in self.signals.items()})
        if self.q_encoder is not None:
            checked = [(x, without_missing(x, 1.0)) for x in self.q_encoder.T]
            none = [self.ok & np.isnan(cleaned) & ~np.isnan(x) for x, cleaned in checked if cleaned is not x]
            if np.any(none):
                gone = np.any(none, axis=0)
                note = f"q_encoder: {int(gone.sum())} rows hold numbers that mean no measurement, and are not ok"
                object.__setattr__(self, "ok", frozen(self.ok & ~gone))
                object.__setattr__(self, "notes", (*self.notes, note))
            bad = np.argwhere(~np.isfinite(self.q_encoder) & self.ok[:, None])
            if len(bad):
                row, joint = (int(i) for i in bad[0])
                raise InputError(
                    f"{where}: q_encoder of joint {self.joint_names[joint]} is "
                    f"{self.q_encoder[row, joint]} at row {row}, where ok is set ({len(bad)} such values); "
                    "clear ok on rows without a measurement"
                )

    def __len__(self) -> int:
        return len(self.q_nominal)

    @property
    def screen(self) -> Screen:
        """Motion and error of each joint, and recorded quantities."""
        q, off = self.q_nominal, None if self.q_encoder is None else (self.q_encoder - self.q_nominal)[self.ok]
        rms = np.full(q.shape[1], np.nan) if off is None or not len(off) else np.sqrt(np.mean(off**2, axis=0))
        held = ", ".join(key for key in JOINT_ARRAYS if getattr(self, key) is not None)
        lasts = "" if self.time is None else f", {np.ptp(self.time):.4g} s"
        title = f"{self.name}: {q.shape[1]} joints, {len(self):,} rows{lasts}{', simulated' * self.simulated}; {held}"
        columns = ("joint", "unit", ("from", ":.2f"), ("to", ":.2f"), ("RMS error", ":.3f"))
        table = Table(columns, shown_rows(self, q.min(axis=0), q.max(axis=0), rms))
        return Screen(title, [table], "; ".join(self.notes))

    @property
    def named_notes(self) -> list[str]:
        """Notes, each with the recording's name before it."""
        return [note if note.startswith(f"{self.name}: ") else f"{self.name}: {note}" for note in self.notes]

    def part(self, first: int, last: int) -> "MotionLog":
        """Return the rows from `first` to before `last`."""
        if not 0 <= first < last <= len(self):
            raise InputError(f'recording "{self.name}": has rows 0 to {len(self)}, got {first}:{last}')
        arrays = {key: getattr(self, key) for key in ("ok", "time", *JOINT_ARRAYS)}
        chosen: dict[str, Any] = {key: None if each is None else each[first:last] for key, each in arrays.items()}
        signals = {key: values[first:last] for key, values in self.signals.items()}
        return replace(self, **chosen, signals=signals)

    def in_order_of(self, target: Jointed, *, of: str) -> "MotionLog":
        """Return the log with joints in another order, by name or in order for J1, J2, ...; a note states it."""
        whose = f'recording "{self.name}"'
        if len(self.joint_names) != len(target.joint_names):
            raise InputError(f"{whose} has joints {joints_text(self)}; {of} {joints_text(target)}")
        names, how = tuple(target.joint_names), "by name, in the order"
        available: Jointed = self
        if self.joint_names == nameless(len(names)) and not set(self.joint_names) & set(names):
            available, how = Joints(names, self.joint_units), "without names, in order as"
        places = joint_indices(target, available, whose=whose, of=of)
        if self.joint_names == names:
            return self
        arrays = {k: values[:, places] for k in JOINT_ARRAYS if (values := getattr(self, k)) is not None}
        return replace(
            self,
            joint_names=names,
            joint_units=tuple(self.joint_units[place] for place in places),
            notes=(*self.notes, f"joints {', '.join(self.joint_names)} were taken {how} {', '.join(names)}"),
            **arrays,
        )

    def of_robot(self, model: Jointed, name: str) -> "MotionLog":
        """Return the log with its joints in a robot's order; an error about missing joints lists the expected names."""
        some = [joint for joint in self.joint_names if joint in model.joint_names]
        of = f'robot "{name}" has'
        if len(self.joint_names) < len(model.joint_names):
            named = ",".join(some) if len(some) == len(self.joint_names) else "NAME,... of those recorded, in order"
            raise InputError(
                f'recording "{self.name}" has joints {joints_text(self)}; {of} {joints_text(model)}; where the others '
                f"were held, catenary identify takes these alone: --joints {named}"
            )
        return self.in_order_of(model, of=of)

    @property
    def starts(self) -> tuple[int, ...]:
        """Rows at which a recording begins: the first, and each after a step back in time."""
        if self.time is None:
            return (0,)
        return (0, *(int(i) + 1 for i in np.flatnonzero(np.diff(self.time) < 0.0)))

    @property
    def row_hashes(self) -> NDArray[np.uint64]:
        """Hash of each row's positions and torques (N,), in single precision; 0 if not measured."""
        arrays = [array for array in (self.q_nominal, self.q_encoder, self.tau) if array is not None]
        columns = [column for array in arrays for column in array.T]
        factors = np.cumprod(np.full(len(columns), _HASH_FACTOR, dtype=np.uint64))
        hashes = np.zeros(len(self), dtype=np.uint64)
        for column, factor in zip(columns, factors, strict=True):
            single = np.nan_to_num(column).clip(-1e38, 1e38).astype(np.float32) + np.float32(0.0)
            hashes += single.view(np.uint32) * factor
        return np.where(self.ok | (self.q_encoder is None), hashes, np.uint64(0))

    @cached_property
    def marks(self) -> tuple[str, ...]:
        """Hashes of some rows of each recording in the log, which identify it in any file, also if cut."""
        ends, hashes = sorted({*self.starts, *self.gaps(), len(self)}), self.row_hashes
        rows = [slice(a, b, max(1, min(len(self) // MARKS, (b - a) // _MIN_MARKS))) for a, b in pairwise(ends)]
        unique = dict.fromkeys(f"{mark:x}" for part in rows for mark in hashes[part] if mark)
        return tuple(unique)

    @property
    def poses(self) -> tuple[tuple[float, ...], ...]:
        """Times [s since 1970] and positions of the arm on some rows; empty if the clock does not show the date."""
        if self.time is None or self.began < FIRST_DATE_S:
            return ()
        rows = np.unique(np.linspace(0, len(self) - 1, POSES).astype(np.int64))
        return tuple(map(tuple, np.column_stack([self.began + self.time, self.q_nominal])[rows].round(5).tolist()))

    @property
    def identity(self) -> dict[str, Any]:
        """Entries of a card under `data` that identify the recording."""
        return {"sha256": self.sha256, "marks": self.marks, "poses": self.poses}

    def was_there(self, when_and_where: ArrayLike) -> bool:
        """Return True if the log has `poses` at their times: the same recording or a part of it, at any rate."""
        poses = np.asarray(when_and_where, dtype=float)
        moved = np.ptp(self.q_nominal, axis=0) > 0.0
        if self.time is None or poses.ndim != 2 or poses.shape[1] != 1 + len(moved) or not moved.any():
            return False
        order = np.argsort(self.time, kind="stable")
        time, at = self.time[order], poses[:, 0] - self.began
        k = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
        steps = np.diff(time)
        there = (at >= time[0]) & (at <= time[-1]) & (steps[k - 1] <= GAP_STEPS * np.median(steps))
        if there.sum() < _MIN_MARKS:
            return False
        q = np.column_stack([np.interp(at[there], time, column) for column in self.q_nominal[order].T])
        away = np.abs(q - poses[there, 1:])[:, moved] / np.ptp(self.q_nominal, axis=0)[moved]
        return bool(np.median(away.max(axis=1)) < _SAME_POSE_SHARE)

    def is_among(self, sources: Iterable[Mapping[str, Any]]) -> bool:
        """Return True if the log or a part of it is among the recordings listed in a card under `data`."""
        sources = list(sources)
        if self.sha256 is not None and self.sha256 in {one["sha256"] for one in sources}:
            return True
        if any(self.was_there(one.get("poses", ())) for one in sources):
            return True
        known = np.array([int(mark, 16) for one in sources for mark in one.get("marks", ())], dtype=np.uint64)
        hits = np.r_[False, np.isin(known, self.row_hashes)]
        return bool((np.convolve(hits, np.ones(_MIN_MARKS)) >= _MIN_MARKS).any())

    def gaps(self, least: float = 0.0) -> tuple[int, ...]:
        """Return the rows after a gap in time: a step longer than GAP_STEPS median steps and than `least` [s]."""
        steps = np.diff(self.time) if self.time is not None else np.zeros(0)
        forward = steps[steps > 0.0]
        if not len(forward):
            return ()
        usual, longest = float(np.median(forward)), float(np.quantile(forward, _GAP_SHARE))
        return tuple((np.flatnonzero(steps > max(GAP_STEPS * usual, 2.0 * longest, least)) + 1).tolist())
