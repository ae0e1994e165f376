"""Corrections of recordings by options: units, swapped columns, signs, scales, offsets, delays."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.units import TO_SI
from catenary.verdict.whole_turns import from_median, turned_back

_ARRAYS = ("q_nominal", "q_encoder", "q_reported", "qd", "tau")  # that an option may name: "tau:J2,J3"
# of steps that name no array
_NEEDS = dict.fromkeys(("shift", "delay", "clock"), "q_encoder") | {"time_unit": "time"}
# keys of `MotionLog.settled` that a model's file may hold
MEND_KEYS = (
    r"^(shift|delay|time_unit|(units|swap|sign|unwrap|scale|offset|couple)(:(q_nominal|q_encoder|q_reported|qd|tau))?)$"
)
AS_TRAINED = "corrected as the model's training data"  # start of a note on such corrections
_MAX_PPM = 1e5  # difference of two clocks that no oscillators reach
_TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "ks": 1e3}


@dataclass(frozen=True)
class Mend:
    """Corrections to recordings before use; texts as in the command's options."""

    # "deg,deg,mm": a unit per joint (rad, deg, m, mm, cm, or mdeg for metres times 180/pi) of positions and velocities;
    # "q_encoder:deg,deg,mm" of one array
    units: tuple[str, ...] = ()
    swap: tuple[str, ...] = ()  # "J1,J2" each: swap these columns of q_encoder, in turn; "tau:J1,J2" of another array
    sign: tuple[str, ...] = ()  # "J3" each: negate this column of q_encoder; "tau:J3" of another array
    unwrap: tuple[str, ...] = ()  # "J5=0.0022" each: subtract whole periods by which q_encoder differs from q_nominal
    scale: tuple[str, ...] = ()  # "J3=0.5" each: multiply this column of q_encoder; "tau:J3=0.5" of another array
    offset: tuple[str, ...] = ()  # "q_nominal:J3=0.1" each: add to this column [rad, m, Nm or N]
    delay: float = 0.0  # delay of the measurement [s]
    # "J2/J1=0.145" each: add 0.145 times the recorded column of J1 to that of J2; "tau:J1/J2=-0.145" of another array;
    # with q_nominal, qd and q_reported are coupled too
    couple: tuple[str, ...] = ()
    # "0.73,50": lead of the sensor's clock at the first row [s], and its growth [ppm]; "J2=0.3" of this joint's alone
    clock: tuple[str, ...] = ()
    shift: int = 0  # delay of the measurement in rows, of a recording without stamps
    time_unit: str = "s"  # of the stamps: s, ms, us, ns, min or ks
    leave_out: tuple[str, ...] = ()  # "100:120" each: leave out rows 100 to 119; "qd": all velocities

    def __call__(self, log: MotionLog, trained: Mapping[str, Sequence[str]] | None = None) -> MotionLog:
        """Return the corrected log; its notes and `settled` state every step.

        A step of `trained`, the corrections of a model's training data, is skipped if this mend or the log's `settled`
        has such a step for that array, or if the log lacks the array.
        """
        own = [(step, text, False) for step, text in self._steps()]
        taken = {_settled(log, step, text)[0] for step, text, _ in own} | set(log.settled)
        for key in [key for key in trained or () if key not in taken]:
            step, _, array = key.partition(":")
            if getattr(log, _NEEDS.get(step, array or "q_nominal")) is not None:
                own += [(step, text, True) for text in (trained or {})[key]]
        notes, settled = (list[str](), list[str]()), dict(log.settled)
        for step, text, as_trained in sorted(own, key=lambda each: list(_STEPS).index(each[0])):
            changed = _STEPS[step](log, text)
            if changed is not log:
                shown = re.sub(r"[^:,=]+=", "", text) if step == "units" else text
                notes[as_trained].append(f"--{step.replace('_', '-')} {shown}")
                key, kept = _settled(log, step, text)
                settled[key] = (*settled.get(key, ()), kept)
            log = changed
        corrections = [f"corrected by {' '.join(notes[0])}"] * bool(notes[0])
        corrections += [f"{AS_TRAINED}: {' '.join(notes[1])}; --as-is disables this"] * bool(notes[1])
        return replace(log, notes=(*log.notes, *corrections), settled=settled) if corrections else log

    def _steps(self) -> list[tuple[str, str]]:
        texts_of = {step: getattr(self, step) for step in _STEPS}
        texts_of |= {
            "delay": (f"{self.delay:g}",) * bool(self.delay),
            "shift": (str(self.shift),) * bool(self.shift),
            "time_unit": (self.time_unit,) * (self.time_unit != "s"),
        }
        return [(step, text) for step, texts in texts_of.items() for text in texts]

    @property
    def options(self) -> tuple[str, ...]:
        """Words of a command line that request this correction."""
        return tuple(word for step, text in self._steps() for word in (f"--{step.replace('_', '-')}", text))

    def and_then(self, remedy: str) -> "Mend | None":
        """Return this correction with options such as "--delay 0.12" added; None if they are no correction."""
        first, *others = re.split(r" (?=--)", remedy.removeprefix("--"))
        option, _, text = first.partition(" ")
        step = option.replace("-", "_")
        if step not in _STEPS or not text:
            return None
        had = getattr(self, step)
        if step in ("delay", "shift"):
            mend = replace(self, **{step: type(had)(had + float(text))})
        elif step == "time_unit" or (step == "units" and had):
            return replace(self, time_unit=text) if had == "s" else None
        else:
            undone = step in ("swap", "sign") and text in had
            texts = tuple(t for t in had if t != text) if undone else (*had, text)
            mend = replace(self, **{step: texts})  # type: ignore[arg-type]  # a field by its name
        return mend.and_then(" ".join(others)) if others else mend


NO_MEND = Mend()


_OF_ONE = "leave_out", "clock"  # steps that apply to one recording only


def mends_of(logs: Sequence[MotionLog]) -> dict[str, tuple[str, ...]]:
    """Return the corrections common to recordings, which similar ones will need, except steps for one recording."""
    common = [key for key, texts in logs[0].settled.items() if all(log.settled.get(key) == texts for log in logs)]
    return {key: logs[0].settled[key] for key in common if logs[0].settled[key] and key not in _OF_ONE}


def _settled(log: MotionLog, step: str, text: str) -> tuple[str, str]:
    """Return the key of a step in `settled`, and its text with joints by name, for recordings in another order."""
    array, words = units_of(text)
    if step == "units":
        words = tuple(w if "=" in w else f"{n}={w}" for n, w in zip(log.joint_names, words, strict=False))
    elif step in ("swap", "sign", "unwrap", "scale", "offset", "couple"):
        array = array or _default(log)
    return (f"{step}:{array}", f"{array}:{','.join(words)}") if array else (step, ",".join(words))


def _default(log: MotionLog) -> str:
    return "q_encoder" if log.q_encoder is not None else "tau"


def si_units(units: Sequence[str]) -> tuple[str, ...]:
    """Return rad or m for each unit of positions."""
    unknown = [unit for unit in units if unit not in TO_SI]
    if unknown:
        raise InputError(f"units: unknown {', '.join(unknown)}; choices: {', '.join(TO_SI)}")
    return tuple(TO_SI[unit][0] for unit in units)


def units_of(text: str) -> tuple[str | None, tuple[str, ...]]:
    """Return the array that an option such as `--units` names, if any, and the words that follow."""
    array, _, units = text.partition(":")
    # a joint's name may hold a colon of its own
    words = tuple(word.strip() for word in (units if array in _ARRAYS else text).split(","))
    return (array if array in _ARRAYS else None), words


def _joint(log: MotionLog, name: str, option: str) -> int:
    if name not in log.joint_names:
        raise InputError(f'recording "{log.name}": {option}: no joint {name!r}; joints: {", ".join(log.joint_names)}')
    return log.joint_names.index(name)


def _array(log: MotionLog, array: str | None, option: str) -> tuple[str, Floats]:
    key = array or _default(log)
    values: Floats | None = getattr(log, key)
    if values is None:
        raise InputError(f'recording "{log.name}": {option}: it has no {key}')
    return key, values.copy()


def _units(log: MotionLog, text: str) -> MotionLog:
    array, units = units_of(text)
    if any("=" in word for word in units):
        named = dict(word.rpartition("=")[::2] for word in units)
        units = tuple(named.get(n, u) for n, u in zip(log.joint_names, log.joint_units, strict=True))
    if si_units(units) != log.joint_units:
        raise InputError(
            f'recording "{log.name}": --units: expected one per joint, angles or lengths as its '
            f"{', '.join(f'{n} [{u}]' for n, u in zip(log.joint_names, log.joint_units, strict=True))}; got {text}"
        )
    factor = np.array([TO_SI[unit][1] for unit in units])
    if (factor == 1.0).all():
        return log
    keys = [array] if array else [key for key in _ARRAYS[:4] if getattr(log, key) is not None]
    changed: dict[str, Any] = {key: _array(log, key, "--units")[1] * factor for key in keys}
    return turned_back(replace(log, **changed))


def _swap(log: MotionLog, text: str) -> MotionLog:
    array, names = units_of(text)
    if len(names) != 2:
        raise InputError(f"--swap: expected two joints such as J1,J2, got {text!r}")
    i, j = (_joint(log, name, "--swap") for name in names)
    key, values = _array(log, array, "--swap")
    values[:, [i, j]] = values[:, [j, i]]
    return replace(log, **{key: values})  # type: ignore[arg-type]  # an array by its name


def _of_columns(step: str, log: MotionLog, text: str) -> MotionLog:
    """Return the log with single columns corrected, each by the number that the option gives its joint."""
    (expected, corrected), option = _COLUMN_STEPS[step], f"--{step}"
    if expected:
        array, numbers = _numbers(text, option, expected)
    else:
        array, names = units_of(text)
        numbers = dict.fromkeys(names, 1.0)
    key, values = _array(log, array, option)
    for name, number in numbers.items():
        j = _joint(log, name, option)
        values[:, j] = corrected(values[:, j], number, log, j)
    return replace(log, **{key: values})  # type: ignore[arg-type]  # an array by its name


# what an option gives each joint, nothing where it names joints alone, and what it makes of a joint's column (N,)
_COLUMN_STEPS: dict[str, tuple[str, Callable[[Floats, float, MotionLog, int], Floats]]] = {
    "sign": ("", lambda values, _, log, j: -values),
    "unwrap": (
        "JOINT=PERIOD such as J5=0.0022",
        lambda values, period, log, j: (
            values - period * np.round(from_median(values - log.q_nominal[:, j], log.ok) / period)
        ),
    ),
    "scale": ("JOINT=FACTOR such as J3=0.5", lambda values, factor, log, j: factor * values),
    "offset": ("JOINT=NUMBER such as q_nominal:J3=0.1", lambda values, number, log, j: values + number),
}


def _couple(log: MotionLog, text: str) -> MotionLog:
    array, entries = _numbers(text, "--couple", "JOINT/JOINT=NUMBER such as J2/J1=0.145")
    key, _ = _array(log, array, "--couple")
    matrix = np.eye(len(log.joint_names))
    for pair, number in entries.items():
        parts = pair.split("/")
        ends = [("/".join(parts[:k]), "/".join(parts[k:])) for k in range(1, len(parts))]  # a name may hold one, too
        row, column = next((both for both in ends if {*both} <= {*log.joint_names}), pair.partition("/")[::2])
        matrix[_joint(log, row, "--couple"), _joint(log, column, "--couple")] += number
    with_it = [key] + ["q_reported", "qd"] * (key == "q_nominal")
    coupled = {name: getattr(log, name) @ matrix.T for name in with_it if getattr(log, name) is not None}
    return replace(log, **coupled)


def _numbers(text: str, option: str, expected: str) -> tuple[str | None, dict[str, float]]:
    """Return the array that an option names, and its non-zero numbers by joint."""
    array, parts = units_of(text)
    numbers = {}
    for part in parts:
        name, _, number = part.rpartition("=")
        try:
            numbers[name] = float(number)
        except ValueError:
            numbers[name] = np.nan
        if not np.isfinite(numbers[name]) or numbers[name] == 0.0:
            raise InputError(f"{option}: expected {expected}, got {part!r}")
    return array, numbers


def _shift(log: MotionLog, text: str) -> MotionLog:
    if not re.fullmatch(r"-?\d{1,9}", text):
        raise InputError(f"--shift: expected rows such as 4, got {text!r}")
    return _later(log, np.arange(float(len(log))), float(text), f"--shift {text}")


def _delay(log: MotionLog, text: str) -> MotionLog:
    if log.time is None:
        raise InputError(f'recording "{log.name}": --delay: it has no time stamps: give --shift ROWS')
    return _later(log, log.time, float(text), f"--delay {text}")


def clock_of(text: str) -> tuple[float, float]:
    """Return the lead of one clock over another at first [s], and its rate of growth (1e-6 for one ppm)."""
    words = text.split(",")
    try:
        ahead, ppm = float(words[0]), float(words[1]) if words[1:] else 0.0
    except ValueError:
        ahead = ppm = np.nan
    if len(words) > 2 or not np.isfinite(ahead) or not abs(ppm) < _MAX_PPM:
        raise InputError(f"--clock: expected seconds and ppm such as 0.73,50, got {text!r}")
    return ahead, 1e-6 * ppm


def _clock(log: MotionLog, text: str) -> MotionLog:
    joint, _, clock = text.rpartition("=")
    ahead, fast = clock_of(clock)
    if log.time is None:
        raise InputError(f'recording "{log.name}": --clock: it has no time stamps')
    own = [_joint(log, joint, "--clock")] if joint else None
    return _later(log, log.time, ahead + fast * (log.time - log.time[0]), f"--clock {text}", own)


def _later(
    log: MotionLog, time: Floats, by: float | Floats, option: str, joints: Sequence[int] | None = None
) -> MotionLog:
    """Return the log with measurements, of all joints or some, read `by` [s, or rows] later, between their neighbours.

    Rows whose neighbours were not both measured are not ok.
    """
    whose = f'recording "{log.name}": {option}'
    if log.q_encoder is None:
        raise InputError(f"{whose}: it has no measured joint positions")
    measured, ok = np.full(log.q_encoder.shape, np.nan), np.zeros(len(log), dtype=bool)
    ahead = np.broadcast_to(by, len(log))
    for first, last in pairwise(sorted({*log.starts, *log.gaps(), len(log)})):
        t, seen, trusted = time[first:last], log.q_encoder[first:last], log.ok[first:last]
        at = t + ahead[first:last]
        after = np.clip(np.searchsorted(t, at), min(1, len(t) - 1), len(t) - 1)  # the row at or after that instant
        share = np.clip((at - t[after - 1]) / np.maximum(t[after] - t[after - 1], 1e-12), 0.0, 1.0)
        before = np.where(share < 1.0, after - 1, after)
        rows = np.flatnonzero((at >= t[0]) & (at <= t[-1]) & trusted[after] & trusted[before])
        near = share[rows, None]
        measured[first + rows] = seen[before[rows]] * (1.0 - near) + seen[after[rows]] * near
        ok[first + rows] = True
    if joints is not None:
        ok, others = ok & log.ok, [j for j in range(len(log.joint_names)) if j not in joints]
        measured[:, others] = log.q_encoder[:, others]
    if not ok.any():
        raise InputError(f"{whose}: no row of {len(log)} is left")
    return replace(log, q_encoder=measured, ok=ok)


def retimed_by(log: MotionLog) -> float:
    """Return the correction of delay that was applied [s, or rows of a log without time]."""
    step = "shift" if log.time is None else "delay"
    return sum(map(float, log.settled.get(step, ())))


def _time_unit(log: MotionLog, unit: str) -> MotionLog:
    if unit not in _TIME_UNITS_S:
        raise InputError(f"--time-unit: unknown {unit!r}; choices: {', '.join(_TIME_UNITS_S)}")
    if unit == "s":
        return log
    if log.time is None:
        raise InputError(f'recording "{log.name}": --time-unit: it has no time stamps')
    return replace(log, time=log.time * _TIME_UNITS_S[unit])


def _leave_out(log: MotionLog, text: str) -> MotionLog:
    if text == "qd":
        return replace(log, qd=None)
    ok = log.ok.copy()
    for part in text.split(","):
        if not re.fullmatch(r"\s*\d+:\d+\s*", part):
            raise InputError(f"--leave-out: expected FIRST:LAST such as 100:120, got {part!r}")
        first, last = map(int, part.split(":"))
        if not first < last <= len(log):
            raise InputError(f'recording "{log.name}": --leave-out: has rows 0 to {len(log)}, got {part}')
        ok[first:last] = False
    if log.q_encoder is None:
        return replace(log, ok=ok)
    measured = log.q_encoder.copy()
    measured[~log.ok] = np.nan  # to distinguish rows left out from rows not measured
    return replace(log, ok=ok, q_encoder=measured)


def left_out_rows(log: MotionLog) -> Flags:
    """Return flags (N,) of measured rows that were left out by an option."""
    rows = np.zeros(len(log), dtype=bool)
    for part in (part for text in log.settled.get("leave_out", ()) for part in text.split(",")):
        first, last = map(int, part.split(":"))
        rows[first:last] = True
    return rows & ~log.ok & (False if log.q_encoder is None else np.isfinite(log.q_encoder).all(axis=1))


# units first, as scales and offsets are in SI; signs and scales name joints after swaps; rows are left out last, as
# findings about rows are made after the correction of delays
_STEPS: dict[str, Callable[[MotionLog, str], MotionLog]] = {
    "units": _units, "time_unit": _time_unit, "swap": _swap,
    **{step: partial(_of_columns, step) for step in _COLUMN_STEPS},
    "couple": _couple, "clock": _clock, "delay": _delay, "shift": _shift, "leave_out": _leave_out,
}  # fmt: skip
