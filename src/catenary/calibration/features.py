"""The numbers that a calibration model takes, in order, and how they come out of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.friction_states import FrictionStates, rub
from catenary.calibration.spike_filter import ANY_SIZE, find_leaps, room_of
from catenary.config import IN_FILES
from catenary.errors import InputError
from catenary.kernels.bind import Step, run
from catenary.kernels.compiled import compiled, inlined
from catenary.plant import MotionLog
from catenary.units import TORQUE_UNIT

Item = TypeVar("Item")
Many = Annotated[tuple[Item, ...], Field(max_length=10_000)]  # of anything that a model has several of
Factor = Annotated[float, Field(ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(gt=0.0)]
_PIECE_ROWS = 20_000  # rows that are computed at once
_GROUPS = ("q", "tau", "qd")  # per-joint quantities of a log; `q` is q_nominal


class Memory(NamedTuple):
    """Play and friction states of a motion, and what else features depend on; every row updates them."""

    play: Floats  # (K,) play states; NaN until the first position, on which they are centred
    friction: Floats  # (2, L) friction states, NaN until the first position: remembered, and of the last row
    seen: Floats  # (J, 3) of the joints that play states follow; see find_leaps
    fast: Floats  # (1,) see find_leaps
    rejected: Floats  # (J,) rows of these joints that were spikes

    def clear(self) -> None:
        """Forget all earlier rows: another motion begins; what was counted stays."""
        self.play[:], self.friction[:] = np.nan, np.nan
        self.seen[:], self.fast[:] = [np.nan, 0.0, 0.0], 0.0


class _Column(NamedTuple):
    """A feature: its name and unit, the signal it comes from, and what it is."""

    name: str
    unit: str
    signal: str
    is_state: bool  # a play or friction state


class FeatureRows(NamedTuple):
    """Features of a recording."""

    X: Floats  # (N, F)
    leaping: Flags  # (N,) rows that leap: intervals are wider
    spikes: dict[str, int]  # of each position that play states follow, how many rows these did not follow


@dataclass(frozen=True)
class FeatureSet:
    """Which features a model takes: signals, play states, and friction states of coupled joints.

    A play state of half-width r follows its position only after it has moved by r: y <- min(max(y, x - r), x + r). It
    remembers on which side of the slack the cable lies, whatever the speed or sampling rate. The feature is y - x,
    which stays within -r and r. [Prandtl-Ishlinskii hysteresis; Brokate and Sprekels 1996] Where a cable runs over
    another joint's drum, what it follows is a path: its joint's position and a factor times the other's.

    A position farther from the one before than its joint's largest step is a leap, which play states do not remember
    unless it stays (spike_filter.py). Rows of less than `period` have as much room as one of it.
    """

    __pydantic_config__ = IN_FILES

    signals: Many[str]  # "q:<joint>", "tau:<joint>", "qd:<joint>", or the name of a further signal
    units: Many[str]  # one per signal
    play: Many[tuple[str, Positive]] = ()  # (position signal or path, half-width in its unit)
    friction: FrictionStates | None = None  # of coupled joints
    steps: Many[tuple[str, Positive]] = ()  # (position signal, largest step to the next row in its unit); others: any
    paths: Many[tuple[str, str, str, Factor]] = ()  # (name, position signal, another one, factor of that)
    period: Positive | None = None  # [s] between the rows of `steps`; None where rows have no time

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
        """The positions and paths that play states and friction states follow, J."""
        coupled = () if self.friction is None else self.friction.positions
        return tuple(dict.fromkeys([*(name for name, _ in self.play), *coupled]))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the features, F."""
        return tuple(column.name for column in self._columns)

    @property
    def feature_units(self) -> tuple[str, ...]:
        """Units of the features, F."""
        return tuple(column.unit for column in self._columns)

    def columns_of(self, signals: Sequence[str]) -> Integers:
        """Return indices of the features that come from the given signals."""
        return np.array([i for i, c in enumerate(self._columns) if c.signal in signals], dtype=np.int64)

    @property
    def bounded(self) -> Flags:
        """Features that cannot leave their range whatever the robot does: play and friction states, (F,)."""
        return np.array([column.is_state for column in self._columns])

    @property
    def play_columns(self) -> dict[int, tuple[str, float]]:
        """Which columns are play states: the position or path that each follows, and its half-width."""
        return dict(enumerate(self.play, len(self.signals)))

    @property
    def owners(self) -> tuple[str, ...]:
        """The joint that each feature comes from, F."""
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
        """Return features of every row, (N, F), commands without measurement too."""
        return self.rows(log).X

    def rows(self, log: MotionLog, kept: Integers | None = None) -> FeatureRows:
        """Return `matrix`, and what leaps on the way; of the rows `kept` alone, rising, though states follow all."""
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
        """Return the signals of every row, (N, S)."""
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
        """Return the number of rows that a memory counted as spikes of each position."""
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
        """Return the compiled steps that write X (N, F) and `leaping` for rows of signals (N, S); see `room_of`."""
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
    """Compute positions or paths along features: signals[:, firsts] + factors * signals[:, seconds].

    Args:
        signals: (N, S).
        firsts: Columns (J,).
        seconds: Columns (J,).
        factors: Factors of the second ones (J,).
        along: (N, J), written.
    """
    for row in range(len(signals)):
        for j in range(len(firsts)):
            along[row, j] = signals[row, firsts[j]]
            if factors[j] != 0.0:
                along[row, j] += factors[j] * signals[row, seconds[j]]


@compiled
def gather(
    signals: Floats,  # (N, S) what the robot reports, row after row
    along: Floats,  # (N, J) positions and paths that play states follow
    owners: Integers,  # (K,) which of these each follows
    widths: Floats,  # (K,) half-widths of the play states
    away: Flags,  # (N, J) see `find_leaps`
    play: Floats,  # (K,) play states
    X: Floats,  # (N, F) receives the features
) -> None:
    """Write the features of rows of one motion, and remember what later rows take; NaN leaves play states."""
    for row in range(len(signals)):
        at = signals.shape[1]
        for i in range(at):
            X[row, i] = signals[row, i]
        for i in range(len(owners)):
            position = along[row, owners[i]]
            X[row, at + i] = after(play[i], position, widths[i]) - position
            if np.isfinite(position) and not away[row, owners[i]]:
                play[i] = after(play[i], position, widths[i])


@inlined
def after(state: float, position: float, width: float) -> float:
    """Return a play state after its position moved; NaN, before the first, becomes that position."""
    state = position if np.isnan(state) else state
    return min(max(state, position - width), position + width)


def signals_of(log: MotionLog) -> dict[str, tuple[Floats, str]]:
    """Return all signals that a model could take from a log by name: values (N,), and their unit."""
    signals: dict[str, tuple[Floats, str]] = {}
    for group, table in zip(_GROUPS, (log.q_nominal, log.tau, log.qd), strict=True):
        columns = () if table is None else zip(log.joint_names, log.joint_units, table.T, strict=True)
        for joint, unit, values in columns:
            of_group = {"q": unit, "qd": f"{unit}/s", "tau": TORQUE_UNIT[unit]}[group]
            signals[f"{group}:{joint}"] = values, of_group
    return signals | {name: (values, log.signal_units.get(name, "")) for name, values in log.signals.items()}


def choose_signals(log: MotionLog, words: Sequence[str]) -> tuple[str, ...]:
    """Turn words into signals: a group (`q`, `tau`, `qd`) means all its joints, `all` every signal."""
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
