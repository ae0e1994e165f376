"""A robot, and its calibration model, as one C header for the control loop of a real robot."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.c_source import c_correction
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.dynamics.lines import gravity_line, gravity_regressor_line
from catenary.errors import InputError
from catenary.files import write_atomically
from catenary.gravity.compact import compact_regressor
from catenary.kernels.c99 import c_function, c_name, c_sines
from catenary.kernels.tracing import evaluate
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL


@dataclass(frozen=True)
class Header:
    """A header's text, and what it holds."""

    text: str
    functions: tuple[str, ...]
    notes: tuple[str, ...]


def c_header(
    model: RobotModel | None, calibration: CalibrationModel | None = None, *, rate_hz: float = 1000.0
) -> Header:
    """Write a robot's gravity torque, its regressor and the joint correction as one self-contained C99 header.

    No memory is allocated, nothing but math.h is called, and it is valid C++11.

    Args:
        model: The robot; the correction alone when None, or where links have no inertia.
        calibration: Its calibration model; no correction when None.
        rate_hz: Of the loop that the correction will run in [Hz]; matters to models with previous positions.

    Raises:
        MissingInertiaError: Links without inertia, and no calibration model.
        InputError: Neither is given, the calibration model cannot run at that rate, or has a predictor that has no C.
    """
    known: CalibrationModel | RobotModel | None = model if model is not None else calibration
    if known is None:
        raise InputError("C header: expected a robot, a calibration model, or both; got neither")
    notes: list[str] = []
    name = c_name("model" if model is None else model.name)
    quantities, functions = list[str](), list[str]()
    if model is not None:
        if calibration is None:
            model.require_masses()
        if model.missing_inertia:
            notes.append(
                f'robot "{model.name}": no inertia for {", ".join(model.missing_inertia)}, so without gravity and '
                "regressor; the header holds the correction alone"
            )
        else:
            quantities, functions = _quantities(model, name)
    guard = f"CATENARY_{name.upper()}_H"
    what = "Calibration model" if model is None else f"Robot {_plain(model.name)}"
    text = [
        f"/* {what}, written by catenary. C99 and C++11; needs math.h, takes no memory.",
        "   Compile without -ffast-math. Angles in rad, lengths in m.",
        f"   Joints: {_joints(known.joint_names, known.joint_units)}. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <math.h>",
        "#include <stddef.h>",
        "",
        f"#define {name.upper()}_JOINTS {len(known.joint_names)}",
        *quantities,
    ]
    if calibration is not None:
        corrector = Corrector(calibration, rate_hz=rate_hz)
        text += [
            f"#define {name.upper()}_SIGNALS {len(calibration.features.signals)}",
            _correction_comment(calibration, corrector),
            c_correction(name, calibration, corrector.decimation, rate_hz),
        ]
        functions += [f"{name}_reset", f"{name}_correct", f"{name}_interval"]
        notes += _other_joints(known, calibration)
    return Header("\n".join([*text, f"#endif /* {guard} */", ""]), tuple(functions), tuple(notes))


def _other_joints(robot: RobotModel | CalibrationModel, calibration: CalibrationModel) -> list[str]:
    known = set(zip(robot.joint_names, robot.joint_units, strict=True))
    calibrated = zip(calibration.joint_names, calibration.joint_units, strict=True)
    missing = [joint for joint, unit in calibrated if (joint, unit) not in known]
    if not missing:
        return []
    return [
        f"the calibration model's joints {', '.join(missing)} are none of the robot's, "
        f"{_joints(robot.joint_names, robot.joint_units)}; the two are exported side by side"
    ]


def _quantities(model: RobotModel, name: str) -> tuple[list[str], list[str]]:
    """Return gravity torque, its regressor and the compact one as text, and the names of their functions."""
    if not np.isfinite(model.coupling).all() or not np.isfinite(model.offset).all():
        raise InputError(f'robot "{model.name}": its coupling holds NaN or infinity')
    gravity, regressor = gravity_line(model), gravity_regressor_line(model)
    links = len(model.link_names)
    q = [0.1 * (k % 7 + 1) for k in range(model.n)]  # to check at, none of them zero
    text = [
        "/* Gravity in m/s2 in the base frame, whose z points up on a level base: (0, 0, -9.81) there. */",
        f"#define {name.upper()}_PARAMETERS {4 * links}",
        "",
        c_sines(name),
        f"/* Torques out[{model.n}] [Nm, N] that hold the arm still at q[{model.n}] under gravity[3]; never negate.",
        f"   {gravity.operations} sums and products. To check: q = {_values(q)}, gravity = {_values(LEVEL)}",
        f"   gives {_values(evaluate(gravity, q=q, gravity=LEVEL.tolist()))}. */",
        c_function(name, "gravity", gravity),
        f"/* Regressor out[{model.n} x {4 * links}], row by row: torques = out s; s holds, for each link, its mass",
        "   [kg] and first moment about the origin of its frame [kg m]: m, mx, my, mz. Links:",
        f"   {', '.join(_plain(link) for link in model.link_names)}. {regressor.operations} sums and products. */",
        c_function(name, "gravity_regressor", regressor),
    ]
    functions = [f"{name}_gravity", f"{name}_gravity_regressor"]
    compact = compact_regressor(model)
    if compact.labels:
        text += [
            f"#define {name.upper()}_COMPACT_PARAMETERS {len(compact.labels)}",
            f"/* Compact regressor out[{model.n} x {len(compact.labels)}], row by row: torques = out s; s is without",
            f"   what no joint feels, and equal entries are one. {compact.line().operations} sums and products. s:",
            *(
                f"     {_plain(label)} [{unit}]"
                for label, unit in zip(compact.labels, compact.units, strict=True)
            ),
            f"   This robot's: {_values(list(compact.parameters()))}. */",
            c_function(name, "compact_regressor", compact.line()),
        ]
        functions.append(f"{name}_compact_regressor")
    return text, functions


def write_header(header: Header, path: Path) -> None:
    """Write a header to a file.

    Raises:
        FileFormatError: The file cannot be written.
    """
    write_atomically(path, header.text.encode("ascii"))


def _correction_comment(model: CalibrationModel, corrector: Corrector) -> str:
    n = len(model.joint_names)
    names = zip(model.features.signals, model.features.units, strict=True)
    signals = ", ".join(f"{_plain(name)} [{_plain(unit)}]" for name, unit in names)
    middle = model.groups[0].valid_range.mean
    q, x = np.zeros(n), np.zeros(len(model.features.signals))
    for column, value in zip(model.groups[0].watched, middle, strict=True):
        if column < len(x):
            x[column] = value
    out, inside = np.empty(n), np.empty(n, dtype=bool)
    corrector.reset()
    corrector.correct(q, x, out, inside)
    corrector.reset()
    return "\n".join(
        [
            f"/* Calibrated positions of {_joints(model.joint_names, model.joint_units)}, at {corrector.rate_hz:g} Hz:",
            f"   one call a tick. q[{n}]: reported positions; signals[{len(x)}]: {signals}.",
            f"   inside[{n}]: 0 where the model is asked outside of what it has seen; a fixed offset is added there.",
            _interval_comment(model),
            f"   To check, after reset: q = {_values(q)}, signals = {_values(x)}",
            f"   gives {_values(out)}, inside {_values(inside.astype(float))}. */",
        ]
    )


def _interval_comment(model: CalibrationModel) -> str:
    if model.intervals is None:
        return "   The model has no intervals: ..._interval(state) gives NAN."
    return (
        f"   ..._interval(state)[{len(model.joint_names)}]: half-widths of the last tick's intervals, which hold "
        f"{100.0 * model.intervals.level:g} per cent of errors."
    )


def _values(values: "Floats | list[float] | tuple[float, ...]") -> str:
    return "(" + ", ".join(f"{value:.17g}" for value in values) + ")"


def _joints(names: tuple[str, ...], units: tuple[str, ...]) -> str:
    return ", ".join(f"{_plain(name)} [{unit}]" for name, unit in zip(names, units, strict=True))


def _plain(text: str) -> str:
    """Keep a name from a file from ending the comment that it stands in."""
    return re.sub(r"[^A-Za-z0-9 _.,:()\[\]+-]", "?", text)
