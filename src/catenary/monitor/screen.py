"""A robot's state as lines of a fixed size: every number keeps its place, so nothing jumps."""

from textwrap import wrap

import numpy as np

from catenary.arrays import Floats
from catenary.monitor.snapshot import Snapshot
from catenary.sensing.vector import tilt_of
from catenary.visible import visible

BAR = 12  # characters of a joint's range
_COLUMNS = {  # by heading: field of the snapshot, characters
    "reported": ("q", 10),
    "calibrated": ("calibrated", 11),
    "+/-": ("interval", 8),
    "set": ("setpoint", 10),
    "encoder": ("encoder", 10),
    "error": ("error", 8),
    "torque": ("tau", 8),
    "gravity": ("gravity_tau", 8),
}


def monitor_lines(
    name: str, shot: Snapshot, columns: int = 80, lines: int = 24, *, colour: bool = False
) -> list[str]:
    """Return exactly `lines` lines of at most `columns` characters, colours not counted.

    Args:
        name: Of the robot or the recording.
        shot: What to show.
        columns: Of the terminal.
        lines: Of the terminal.
        colour: Show warnings in red.
    """
    shown = [_fit(_left_right(f"catenary monitor  {name}", _state(shot), columns), columns)]
    rate = "-" if shot.rate_hz is None else f"{shot.rate_hz:.0f} Hz"
    shown += [_fit(_left_right(f"time {shot.time:10.2f} s", f"states {rate:>8}", columns), columns), ""]
    heads = [head for head, (field, _) in _COLUMNS.items() if _is_known(getattr(shot, field), head)]
    while heads and 14 + sum(_COLUMNS[head][1] for head in heads) > columns:
        heads.pop()  # half a column tells nothing
    titles = "".join(head.rjust(_COLUMNS[head][1]) for head in heads)
    has_room = 14 + len(titles) + 3 + BAR + 2 <= columns
    shown.append(_fit(f"{'':<14}{titles}{'   range' if has_room else ''}", columns))
    for j, joint in enumerate(shot.joint_names):
        unit = "deg" if shot.joint_units[j] == "rad" else "mm"
        cells = "".join(_cell(shot, head, j) for head in heads)
        shown.append(_fit(f"{joint[:9]:<10}{unit:<4}{cells}   {_bar(shot, j) if has_room else ''}", columns))
    shown += ["", _fit(_gravity(shot), columns)]
    if shot.tip is not None:
        shown.append(_fit(tip_line(shot), columns))
    warnings = shot.warnings()
    shown += [_fit(shot.recording, columns), ""] if shot.recording is not None else [""]
    told = [line for text in warnings for line in _folded(f"! {text}", columns)]
    shown += [_warned(line, colour) for line in told] or ["no warnings"]
    last = _fit("Q quit", columns)
    shown = shown[: max(0, lines - 1)]
    shown += [""] * (lines - 1 - len(shown)) + [last]
    return shown[:lines]


def plain_line(shot: Snapshot) -> str:
    """Return one line for a pipe or a file: time, state, joints in deg and mm, warnings.

    Reported joints by name; calibrated and measured ones, where there are any, in the same order and units.
    """
    values = " ".join(
        f"{joint}={_human(value, unit):.2f}{'deg' if unit == 'rad' else 'mm'}"
        for joint, value, unit in zip(shot.joint_names, shot.q, shot.joint_units, strict=True)
    )
    for name, others in (("calibrated", shot.calibrated), ("measured", shot.encoder)):
        if others is not None and np.isfinite(others).any():
            told = zip(others, shot.joint_units, strict=False)  # a robot's encoders are at its first joints
            shown = (f"{_human(value, unit):.2f}" if np.isfinite(value) else "-" for value, unit in told)
            values += f"  {name} {' '.join(shown)}"
    if shot.tip_error is not None:
        values += f"  tip {_tip_errors(shot)}"
    warnings = "; ".join(shot.warnings())
    return f"{shot.time:.2f} s  {_state(shot)}  {values}" + (f"  ! {warnings}" if warnings else "")


def tip_line(shot: Snapshot) -> str:
    """Return where the tip is by reported joints and, in a simulation, how far from where it is [mm]."""
    if shot.tip is None:
        return ""
    x, y, z = 1e3 * shot.tip
    place = f"tip {x:.1f} {y:.1f} {z:.1f} mm"
    return place if shot.tip_error is None else f"{place}  {_tip_errors(shot)}"


def _tip_errors(shot: Snapshot) -> str:
    text = f"error {1e3 * (shot.tip_error or 0.0):.2f} mm"
    calibrated, reported = shot.calibrated_from_encoders, shot.tip_from_encoders
    if calibrated is None or reported is None:
        return text
    return f"{text}; by encoders {1e3 * reported:.2f}, calibrated {1e3 * calibrated:.2f} mm"


def _cell(shot: Snapshot, head: str, j: int) -> str:
    field, width = _COLUMNS[head]
    values: Floats = getattr(shot, field)
    if j >= len(values) or not np.isfinite(values[j]):
        return "-".rjust(width)
    if head in ("torque", "gravity"):
        return f"{values[j]:.3f}".rjust(width)  # [Nm], [N]
    outside = head == "calibrated" and shot.inside is not None and not shot.inside[j]
    return f"{_human(values[j], shot.joint_units[j]):.2f}{'?' if outside else ''}".rjust(width)


def _is_known(values: Floats | None, head: str) -> bool:
    """Return whether a column is shown: intervals only of a model that has some."""
    return values is not None and (head != "+/-" or not np.isnan(values).all())


def _human(value: float, unit: str) -> float:
    return float(np.rad2deg(value) if unit == "rad" else 1e3 * value)


def _bar(shot: Snapshot, j: int) -> str:
    if shot.lower is None or shot.upper is None:
        return ""
    low, high = shot.lower[j], shot.upper[j]
    if not (np.isfinite(low) and np.isfinite(high) and np.isfinite(shot.q[j])):
        return "no limits"
    place = int(np.clip((shot.q[j] - low) / (high - low), 0.0, 1.0) * (BAR - 1) + 0.5)
    return "[" + "." * place + "#" + "." * (BAR - 1 - place) + "]"


def _state(shot: Snapshot) -> str:
    if shot.operating is None:
        return "recording"
    state, is_homed, is_busy = shot.operating
    return f"{state}, {'busy' if is_busy else 'homed' if is_homed else 'not homed'}"


def _gravity(shot: Snapshot) -> str:
    if shot.gravity is None:
        return "gravity  not known"
    x, y, z = shot.gravity
    tilt = tilt_of(shot.gravity) if shot.gravity.any() else (np.nan, np.nan)
    roll, pitch = np.round(np.rad2deg(tilt), 2) + 0.0  # no -0.00
    age = f"age {1e3 * shot.gravity_age:.0f} ms" if np.isfinite(shot.gravity_age) else "nominal"
    return f"gravity {x:7.3f} {y:7.3f} {z:7.3f} m/s2  roll {roll:6.2f} pitch {pitch:6.2f} deg  {age}"


def _left_right(left: str, right: str, columns: int) -> str:
    return left + " " * max(2, columns - len(left) - len(right)) + right


def _folded(text: str, columns: int) -> list[str]:
    """Return a text as lines: why a robot is in FAULT is not cut off."""
    return wrap(visible(text.replace("\n", " ")), max(8, columns), subsequent_indent="  ")


def _fit(text: str, columns: int) -> str:
    return visible(text.replace("\n", " "))[:columns].rstrip()


def _warned(text: str, colour: bool) -> str:
    return f"\x1b[31m{text}\x1b[0m" if colour else text
