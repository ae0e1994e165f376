"""Recordings mended: other units, columns in another order, signs, shifted rows, as options say it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import MotionLog

ARRAYS = ("q_nominal", "q_encoder", "qd", "tau")  # that an option may name: "tau:J2,J3"
TO_SI = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "mdeg": np.pi / 180.0}
SI = {"rad": "rad", "deg": "rad", "m": "m", "mm": "m", "cm": "m", "mdeg": "m"}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "ks": 1e3}


@dataclass(frozen=True)
class Mend:
    """What to change of recordings before they are used; texts are as the command's options.

    Attributes:
        units: "deg,deg,mm": a unit per joint (rad, deg, m, mm, cm, or mdeg for metres times 180/pi) of positions and
            velocities; "q_encoder:deg,deg,mm" of one array.
        swap: "J1,J2" each, one after the other: these columns of q_encoder change places; "tau:J1,J2" of another array.
        sign: "J3" each: the column of q_encoder changes its sign; "tau:J3" of another array.
        scale: "J3=0.5" each: the column of q_encoder times that; "tau:J3=0.5" of another array.
        shift: Rows by which the measurement lies behind the command.
        time_unit: Unit of the stamps: s, ms, us, ns, min or ks.
        leave_out: "100:120" each: rows from the first to the one before the last are not trusted.
    """

    units: tuple[str, ...] = ()
    swap: tuple[str, ...] = ()
    sign: tuple[str, ...] = ()
    scale: tuple[str, ...] = ()
    shift: int = 0
    time_unit: str = "s"
    leave_out: tuple[str, ...] = ()

    def __call__(self, log: MotionLog) -> MotionLog:
        """Return the log, mended; its notes say how.

        Raises:
            InputError: An option names a joint, an array or a unit that there is not.
        """
        if self == NOTHING:
            return log
        notes = []
        for name, apply in _STEPS.items():
            given = getattr(self, name)
            for one in given if isinstance(given, tuple) else (given,):
                changed = apply(log, one)
                if changed is not log:
                    notes.append(f"--{name.replace('_', '-')} {one}")
                log = changed
        return replace(log, notes=(*log.notes, *([f"mended by {' '.join(notes)}"] if notes else [])))


NOTHING = Mend()


def si_units(units: Sequence[str]) -> tuple[str, ...]:
    """Return rad or m for each unit that positions may be in.

    Raises:
        InputError: An unknown unit.
    """
    unknown = [unit for unit in units if unit not in SI]
    if unknown:
        raise InputError(f"units: unknown {', '.join(unknown)}; choices: {', '.join(SI)}")
    return tuple(SI[unit] for unit in units)


def units_of(text: str) -> tuple[str | None, tuple[str, ...]]:
    """Return the array that `--units` names, if any, and the units."""
    array, words = _parts(text)
    return array, words


def _parts(text: str) -> tuple[str | None, tuple[str, ...]]:
    array, colon, rest = text.partition(":")
    if not colon:
        array, rest = "", text
    words = tuple(word.strip() for word in rest.split(","))
    # a joint's name may hold a colon of its own
    return (array, words) if array in ARRAYS else (None, tuple(word.strip() for word in text.split(",")))


def _joint(log: MotionLog, name: str, option: str) -> int:
    if name not in log.joint_names:
        raise InputError(
            f'recording "{log.name}": {option}: no joint {name!r}; joints: {", ".join(log.joint_names)}'
        )
    return log.joint_names.index(name)


def _array(log: MotionLog, array: str | None, option: str) -> tuple[str, Floats]:
    key = array or ("q_encoder" if log.q_encoder is not None else "tau")
    values: Floats | None = getattr(log, key)
    if values is None:
        raise InputError(f'recording "{log.name}": {option}: it has no {key}')
    return key, values.copy()


def _units(log: MotionLog, text: str) -> MotionLog:
    array, units = _parts(text)
    if si_units(units) != log.joint_units:
        raise InputError(
            f'recording "{log.name}": --units: expected one per joint, angles or lengths as its '
            f"{', '.join(f'{n} [{u}]' for n, u in zip(log.joint_names, log.joint_units, strict=True))}; got {text}"
        )
    factor = np.array([TO_SI[unit] for unit in units])
    if (factor == 1.0).all():
        return log
    keys = (
        [array]
        if array
        else [key for key in ("q_nominal", "q_encoder", "qd") if getattr(log, key) is not None]
    )
    changed: dict[str, Any] = {key: _array(log, key, "--units")[1] * factor for key in keys}
    return replace(log, **changed)


def _swap(log: MotionLog, text: str) -> MotionLog:
    array, names = _parts(text)
    if len(names) != 2:
        raise InputError(f"--swap: expected two joints such as J1,J2, got {text!r}")
    i, j = (_joint(log, name, "--swap") for name in names)
    key, values = _array(log, array, "--swap")
    values[:, [i, j]] = values[:, [j, i]]
    return replace(log, **{key: values})  # type: ignore[arg-type]  # an array by its name


def _sign(log: MotionLog, text: str) -> MotionLog:
    array, names = _parts(text)
    key, values = _array(log, array, "--sign")
    values[:, [_joint(log, name, "--sign") for name in names]] *= -1.0
    return replace(log, **{key: values})  # type: ignore[arg-type]


def _scale(log: MotionLog, text: str) -> MotionLog:
    array, parts = _parts(text)
    key, values = _array(log, array, "--scale")
    for part in parts:
        name, _, number = part.rpartition("=")
        try:
            factor = float(number)
        except ValueError:
            factor = np.nan
        if not np.isfinite(factor) or factor == 0.0:
            raise InputError(f"--scale: expected JOINT=FACTOR such as J3=0.5, got {part!r}")
        values[:, _joint(log, name, "--scale")] *= factor
    return replace(log, **{key: values})  # type: ignore[arg-type]


def _shift(log: MotionLog, rows: int) -> MotionLog:
    if rows == 0:
        return log
    if log.q_encoder is None:
        raise InputError(f'recording "{log.name}": --shift: it has no measured joint positions')
    measured, ok = np.full(log.q_encoder.shape, np.nan), np.zeros(len(log), dtype=bool)
    for first, last in pairwise(sorted({*log.starts, *log.gaps(), len(log)})):
        if abs(rows) < last - first:
            target = slice(first + max(0, -rows), last - max(0, rows))
            source = slice(target.start + rows, target.stop + rows)
            measured[target], ok[target] = log.q_encoder[source], log.ok[source]
    if not ok.any():
        raise InputError(f'recording "{log.name}": --shift {rows}: no row of {len(log)} is left')
    return replace(log, q_encoder=measured, ok=ok)


def _time_unit(log: MotionLog, unit: str) -> MotionLog:
    if unit not in TIME_UNITS:
        raise InputError(f"--time-unit: unknown {unit!r}; choices: {', '.join(TIME_UNITS)}")
    if unit == "s":
        return log
    if log.time is None:
        raise InputError(f'recording "{log.name}": --time-unit: it has no time stamps')
    return replace(log, time=log.time * TIME_UNITS[unit])


def _leave_out(log: MotionLog, text: str) -> MotionLog:
    ok = log.ok.copy()
    for part in text.split(","):
        first, _, last = part.partition(":")
        try:
            rows = slice(int(first), int(last))
        except ValueError:
            raise InputError(f"--leave-out: expected FIRST:LAST such as 100:120, got {part!r}") from None
        if not 0 <= rows.start < rows.stop <= len(log):
            raise InputError(f'recording "{log.name}": --leave-out: has rows 0 to {len(log)}, got {part}')
        ok[rows] = False
    return replace(log, ok=ok)


# units first: scales and shifts are of what is meant; signs and scales name joints as they stand after the swaps
_STEPS: dict[str, Callable[[MotionLog, Any], MotionLog]] = {
    "leave_out": _leave_out,
    "units": _units,
    "time_unit": _time_unit,
    "swap": _swap,
    "sign": _sign,
    "scale": _scale,
    "shift": _shift,
}
