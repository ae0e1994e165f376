"""Features of a calibration model (signals, play and friction states), and their values in a recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.spike_filter import ANY_SIZE, find_leaps, room_of
from catenary.config import IN_FILES
from catenary.errors import InputError
from catenary.kernels.bind import Step, run
from catenary.kernels.compiled import compiled, inlined
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import CoupledFriction, drag_state, lag_of
from catenary.units import TORQUE_UNIT

Item = TypeVar("Item")
Many = Annotated[tuple[Item, ...], Field(max_length=10_000)]  # size limit of sequences in a model's file
Factor = Annotated[float, Field(ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(gt=0.0)]
Row = Annotated[tuple[Annotated[float, Field(ge=-1e100, le=1e100)], ...], Field(max_length=100)]
Matrix = Annotated[tuple[Row, ...], Field(max_length=100)]
_PIECE_ROWS = 20_000  # rows computed at once
_GROUPS = ("q", "tau", "qd")  # per-joint quantities of a log; `q` is q_nominal


class Memory(NamedTuple):
    """States on which features depend, updated by every row of a motion."""

    play: Floats  # (K,) play states; NaN until the first position, which centres them
    friction: Floats  # (2, L) friction states, remembered and of the last row; NaN until the first position
    seen: Floats  # (J, 3) state of the spike filter per followed position; see find_leaps
    fast: Floats  # (1,) see find_leaps
    rejected: Floats  # (J,) number of spikes per followed position

    def clear(self) -> None:
        """Forget all earlier rows, before another motion; counts of spikes are kept."""
        self.play[:], self.friction[:] = np.nan, np.nan
        self.seen[:], self.fast[:] = [np.nan, 0.0, 0.0], 0.0


class _Column(NamedTuple):
    name: str
    unit: str
    signal: str
    is_state: bool  # a play or friction state


class FeatureRows(NamedTuple):
    """Features of a recording."""

    X: Floats  # (N, F)
    leaping: Flags  # (N,) rows with a leap, whose intervals are wider
    spikes: dict[str, int]  # number of rows of each position that play states did not follow


@dataclass(frozen=True)
class FrictionStates:
    """Numbers of `CoupledFriction`, computed once, that n positions move: a loop must find the evaluated bits."""

    __pydantic_config__ = IN_FILES

    positions: Annotated[tuple[str, ...], Field(max_length=100)]  # (n,) "q:<joint>"
    longest: Row
    directions: Matrix
    mutual: Matrix
    hold: Matrix
    lever: Matrix
    thresholds: Matrix

    def __post_init__(self) -> None:
        n, m, systems = len(self.positions), len(self.directions), len(self.thresholds)
        shapes = {"longest": (n,), "directions": (m, n), "mutual": (m, m), "hold": (m, n), "lever": (n, m)}
        actual = {name: np.shape(getattr(self, name)) for name in shapes}
        fits = actual == shapes and np.shape(self.thresholds) == (systems, m) and min(n, m, systems) > 0
        if not fits or len(set(self.positions)) != n or not min(self.longest) > 0.0:
            raise InputError(f"friction states of {', '.join(self.positions)}: matrices do not fit together, {actual}")
        if not all(self.mutual[k][k] > 0.0 for k in range(m)) or min(map(min, self.thresholds)) < 0.0:
            raise InputError("friction states: expected compliances above zero and thresholds of zero or more")

    @staticmethod
    def of(positions: tuple[str, ...], friction: CoupledFriction) -> "FrictionStates":
        """Return the friction states of positions."""
        longest, *matrices = (array.tolist() for array in friction)
        return FrictionStates(positions, tuple(longest), *(tuple(map(tuple, matrix)) for matrix in matrices))

    @property
    def constants(self) -> CoupledFriction:
        """Springs and friction as arrays."""
        return CoupledFriction(*(np.array(getattr(self, name)) for name in CoupledFriction._fields))

    @property
    def columns(self) -> list[tuple[str, str]]:
        """Name of each feature, and the position whose lag it is."""
        systems = range(1, len(self.thresholds) + 1)
        return [(f"friction({position}, {c})", position) for c in systems for position in self.positions]

    @property
    def size(self) -> int:
        """Size of a state: the previous positions, and the forces of every system."""
        return len(self.positions) + len(self.thresholds) * len(self.directions)


@dataclass(frozen=True)
class FeatureSet:
    """The features of a model: signals, play states, and friction states of coupled joints.

    A play state of half-width r follows its position after it has moved by r: y <- min(max(y, x - r), x + r). It
    remembers the side of the slack on which the cable rests, at any speed or sampling rate. The feature is y - x, which
    stays within -r and r. [Prandtl-Ishlinskii hysteresis; Brokate and Sprekels 1996] If a cable runs over another
    joint's drum, the play state follows a path: its joint's position plus a factor times the other's.

    A change of position by more than the joint's largest step is a leap, which play states ignore unless it persists
    (spike_filter.py). Rows closer in time than `period` are allowed as large a step as rows one `period` apart.
    """

    __pydantic_config__ = IN_FILES

    signals: Many[str]  # "q:<joint>", "tau:<joint>", "qd:<joint>", or the name of another signal
    units: Many[str]  # one per signal
    play: Many[tuple[str, Positive]] = ()  # (position signal or path, half-width in its unit)
    friction: FrictionStates | None = None  # of coupled joints
    steps: Many[tuple[str, Positive]] = ()  # (position signal, largest step to the next row in its unit); else no limit
    paths: Many[tuple[str, str, str, Factor]] = ()  # (name, position signal, second position signal, its factor)
    period: Positive | None = None  # [s] between the rows of `steps`; None if rows have no time

    def __post_init__(self) -> None:
        coupled = () if self.friction is None else self.friction.positions
        if not set(coupled) <= {name for name in self.signals if name.startswith("q:")}:
            raise InputError(f"friction states of {', '.join(coupled)}: expected positions among the inputs")
        if not self.signals:
            raise InputError("inputs: expected at least one signal, got none")
        known = {*self.signals, *(name for name, *_ in self.paths)}
        along = {name for _, *both, _ in self.paths for name in both} | {name for name, _ in self.play}
        if not along <= known or {name for name, *_ in self.paths} & set(self.signals):
            raise InputError(
                f"play states follow {', '.join(sorted(along))}: expected signals among the inputs, or paths"
            )
        if not all(0.0 < step < np.inf for step in [*dict(self.steps).values(), self.period or 1.0]):
            raise InputError(f"steps: expected positive limits, got {self.steps} in rows of {self.period} s")

    @property
    def played(self) -> tuple[str, ...]:
        """The J positions and paths that play states and friction states follow."""
        coupled = () if self.friction is None else self.friction.positions
        return tuple(dict.fromkeys([*(name for name, _ in self.play), *coupled]))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the F features."""
        return tuple(column.name for column in self._columns)

    @property
    def feature_units(self) -> tuple[str, ...]:
        """Units of the F features."""
        return tuple(column.unit for column in self._columns)

    def columns_of(self, signals: Sequence[str]) -> Integers:
        """Return indices of the features that come from the given signals."""
        return np.array([i for i, c in enumerate(self._columns) if c.signal in signals], dtype=np.int64)

    @property
    def bounded(self) -> Flags:
        """Flags (F,) of features that cannot leave their range: play and friction states."""
        return np.array([column.is_state for column in self._columns])

    @property
    def play_columns(self) -> dict[int, tuple[str, float]]:
        """Columns that are play states, with the position or path that each follows and its half-width."""
        return dict(enumerate(self.play, len(self.signals)))

    @property
    def owners(self) -> tuple[str, ...]:
        """The joint of each of the F features."""
        return tuple(column.signal.rpartition(":")[2] for column in self._columns)

    @cached_property
    def _columns(self) -> list[_Column]:
        unit = dict(zip(self.signals, self.units, strict=True))
        along = {name: position for name, position, _, _ in self.paths}
        states = [(f"play({p}, {width:.4g})", along.get(p, p)) for p, width in self.play]
        states += [] if self.friction is None else self.friction.columns
        return [
            *(_Column(signal, unit[signal], signal, is_state=False) for signal in self.signals),
            *(_Column(name, unit[p], p, is_state=True) for name, p in states),
        ]

    def matrix(self, log: MotionLog) -> Floats:
        """Return the features of every row (N, F), rows without a measurement included."""
        return self.rows(log).X

    def rows(self, log: MotionLog, kept: Integers | None = None) -> FeatureRows:
        """Return features and leaps of all rows, or of the increasing rows `kept`; states follow all rows."""
        signals, memory, room = self.signal_rows(log), self.memory(), room_of(log, self.period)
        count = len(log) if kept is None else len(kept)
        X, leaping = np.empty((count, len(self.names))), np.zeros(count, dtype=bool)
        starts = set(log.starts)
        for first, last in pairwise(sorted({*starts, *range(0, len(log), _PIECE_ROWS), len(log)})):
            if first in starts:
                memory.clear()
            rows = slice(first, last)
            into = rows if kept is None else slice(*np.searchsorted(kept, (first, last)))
            part = X[rows] if kept is None else np.empty((last - first, X.shape[1]))
            leaps = np.zeros(last - first, dtype=bool)
            run(self.row_steps(signals[rows], memory, part, room[rows], leaps))
            taken = slice(None) if kept is None else kept[into] - first
            X[into], leaping[into] = part[taken], leaps[taken]
        return FeatureRows(X, leaping, self.spikes(memory))

    def signal_rows(self, log: MotionLog) -> Floats:
        """Return the signals of every row (N, S)."""
        known, columns = signals_of(log), []
        for name, expected in zip(self.signals, self.units, strict=True):
            if name not in known:
                raise _unknown(log, name)
            values, unit = known[name]
            what = f'recording "{log.name}": input "{name}" is'
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                raise InputError(f"{what} {values[bad[0]]} at row {bad[0]} ({len(bad)} such rows)")
            if unit != expected:
                raise InputError(f'{what} in "{unit}", expected "{expected}"')
            columns.append(values)
        return np.column_stack(columns)

    def spikes(self, memory: Memory) -> dict[str, int]:
        """Return the number of spikes of each position that a memory counted."""
        return {name: int(count) for name, count in zip(self.played, memory.rejected, strict=True)}

    def memory(self) -> Memory:
        """Return an empty memory."""
        joints, lags = len(self.played), 0 if self.friction is None else self.friction.size
        memory = Memory(
            np.empty(len(self.play)), np.empty((2, lags)), np.empty((joints, 3)), np.zeros(1), np.zeros(joints)
        )
        memory.clear()
        return memory

    def row_steps(self, signals: Floats, memory: Memory, X: Floats, room: Floats, leaping: Flags) -> list[Step]:
        """Return compiled steps that write X (N, F) and `leaping` (N,) for rows of signals (N, S); see `room_of`."""
        limits = np.array([dict(self.steps).get(name, ANY_SIZE) for name in self.played])
        away, along = np.zeros((len(signals), len(limits)), dtype=bool), np.empty((len(signals), len(limits)))
        paths = {name: (position, other, factor) for name, position, other, factor in self.paths}
        parts = [paths.get(name, (name, name, 0.0)) for name in self.played]
        firsts, seconds = self._places([part[0] for part in parts]), self._places([part[1] for part in parts])
        factors = np.array([factor for _, _, factor in parts], dtype=float)
        owners = np.array([self.played.index(name) for name, _ in self.play], dtype=np.int64)
        widths = np.array([width for _, width in self.play], dtype=float)
        leaps = Step(find_leaps, (along, limits, room), (memory.seen, memory.fast, memory.rejected, away, leaping))
        features = Step(gather, (signals, along, owners, widths, away), (memory.play, X))
        steps = [Step(follow, (signals, firsts, seconds, factors), (along,)), *[leaps] * bool(self.steps), features]
        if self.friction is not None:
            constants, coupled = self.friction.constants, self.friction.positions
            at = np.array([X.shape[1] - len(self.friction.columns)], dtype=np.int64)
            owner = np.array([self.played.index(name) for name in coupled], dtype=np.int64)
            n, m = constants.lever.shape
            work = (np.empty(n), np.empty(n), np.empty(m))
            steps.append(
                Step(rub, (signals, self._places(coupled), owner, away, at, *constants), (*work, memory.friction, X))
            )
        return steps

    def _places(self, signals: Sequence[str]) -> Integers:
        return np.array([self.signals.index(name) for name in signals], dtype=np.int64)


@compiled
def follow(signals: Floats, firsts: Integers, seconds: Integers, factors: Floats, along: Floats) -> None:
    """Write positions or paths: along (N, J) = signals[:, firsts] + factors * signals[:, seconds]."""
    for row in range(len(signals)):
        for j in range(len(firsts)):
            along[row, j] = signals[row, firsts[j]]
            if factors[j] != 0.0:
                along[row, j] += factors[j] * signals[row, seconds[j]]


@compiled
def gather(
    signals: Floats,  # (N, S) reported by the robot
    along: Floats,  # (N, J) positions and paths that play states follow
    owners: Integers,  # (K,) column of `along` that each play state follows
    widths: Floats,  # (K,) half-widths of the play states
    away: Flags,  # (N, J) see `find_leaps`
    play: Floats,  # (K,) play states
    X: Floats,  # (N, F) receives the features
) -> None:
    """Write the features of rows of one motion and update the play states; NaN leaves these unchanged."""
    for row in range(len(signals)):
        at = signals.shape[1]
        for i in range(at):
            X[row, i] = signals[row, i]
        for i in range(len(owners)):
            position = along[row, owners[i]]
            X[row, at + i] = after(play[i], position, widths[i]) - position
            if np.isfinite(position) and not away[row, owners[i]]:
                play[i] = after(play[i], position, widths[i])


@compiled
def rub(
    signals: Floats,  # (N, S) what the robot reports, row after row
    places: Integers,  # (n,) which signals the positions are
    owners: Integers,  # (n,) which columns of `away` these have
    away: Flags,  # (N, J) see `find_leaps`
    at: Integers,  # (1,) first column to write
    longest: Floats,  # (n,); this and the following are those of CoupledFriction
    directions: Floats,  # (m, n)
    mutual: Floats,  # (m, m)
    hold: Floats,  # (m, n)
    lever: Floats,  # (n, m)
    thresholds: Floats,  # (C, m)
    position: Floats,  # (n,) working memory; also the two that follow
    moved: Floats,  # (n,)
    slip: Floats,  # (m,)
    friction: Floats,  # (2, n + C m) states: remembered, and of the last row; NaN before the first
    X: Floats,  # (N, F) receives lags, system by system
) -> None:
    """Write friction states of rows of one motion, leaps as for play states, and remember what later rows take."""
    n, m = len(places), len(slip)
    for row in range(len(signals)):
        finite, leapt = True, False
        for j in range(n):
            position[j] = signals[row, places[j]]
            finite, leapt = finite and np.isfinite(position[j]), leapt or away[row, owners[j]]
        if finite:
            friction[1] = friction[0]
            drag_state(position, longest, directions, mutual, hold, thresholds, friction[1], moved, slip)
            if not leapt:
                friction[0] = friction[1]
        for c in range(len(thresholds)):
            forces = friction[1, n + c * m : n + (c + 1) * m]
            for j in range(n):
                X[row, at[0] + c * n + j] = lag_of(j, lever, forces) if finite else np.nan


@inlined
def after(state: float, position: float, width: float) -> float:
    """Return a play state after its position moved; an initial NaN becomes that position."""
    state = position if np.isnan(state) else state
    return min(max(state, position - width), position + width)


def signals_of(log: MotionLog) -> dict[str, tuple[Floats, str]]:
    """Return all signals of a log that a model could take, by name: values (N,) and unit."""
    signals: dict[str, tuple[Floats, str]] = {}
    for group, table in zip(_GROUPS, (log.q_nominal, log.tau, log.qd), strict=True):
        columns = () if table is None else zip(log.joint_names, log.joint_units, table.T, strict=True)
        for joint, unit, values in columns:
            of_group = {"q": unit, "qd": f"{unit}/s", "tau": TORQUE_UNIT[unit]}[group]
            signals[f"{group}:{joint}"] = values, of_group
    return signals | {name: (values, log.signal_units.get(name, "")) for name, values in log.signals.items()}


def choose_signals(log: MotionLog, words: Sequence[str]) -> tuple[str, ...]:
    """Return the signals of a log that words select: names, groups (`q`, `tau`, `qd`) of all joints, or `all`."""
    known = tuple(signals_of(log))
    if not words:
        raise InputError(f"inputs: expected at least one of {', '.join(known)}")
    chosen: list[str] = []
    for word in words:
        meant = [name for name in known if word in ("all", name, name.partition(":")[0])]
        if not meant or (word not in known and word not in (*_GROUPS, "all")):
            raise _unknown(log, word)
        chosen += meant
    return tuple(dict.fromkeys(chosen))


def _unknown(log: MotionLog, name: str) -> InputError:
    known = signals_of(log)
    groups = [group for group in _GROUPS if any(signal.startswith(f"{group}:") for signal in known)]
    return InputError(
        f'recording "{log.name}": has no input "{name}"; it has {", ".join(known)}, '
        f"and the groups {', '.join(groups)} and all"
    )
