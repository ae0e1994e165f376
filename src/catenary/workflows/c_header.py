"""A robot, and its calibration model, as one C header for the control loop of a real robot."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary.calibration.c_source import c_correction
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.errors import InputError
from catenary.files import write_atomically
from catenary.kernels.c99 import c_comment, c_name
from catenary.robots.model import RobotModel
from catenary.workflows.c_robot import c_gravity, c_motion, c_values


@dataclass(frozen=True)
class Header:
    """A header's text, and what it holds."""

    text: str
    functions: tuple[str, ...]
    notes: tuple[str, ...]


def c_header(
    model: RobotModel | None,
    calibration: CalibrationModel | None = None,
    *,
    rate_hz: float = 1000.0,
    loads: ActuationLoads | None = None,
) -> Header:
    """Write a robot's law of motion, regressors of gravity and joint correction as one self-contained C99 header.

    No memory is allocated, nothing but math.h is called, and it is valid C++11. Where links have masses but no
    possible inertia the law is that of gravity alone.

    Args:
        model: The robot; the correction alone when None, or where links have no inertia.
        calibration: Its calibration model; no correction when None.
        rate_hz: Of the loop that the correction will run in [Hz]; matters to models with previous positions.
        loads: Its friction, rotors, springs and known torques, which the feedforward then includes; those that it
            brings, as an identified robot does, when None.

    Raises:
        MissingInertiaError: Links without inertia, and no calibration model, or loads that would be left out.
        InputError: Neither is given, the calibration model cannot run at that rate, or has a predictor that has no C.
    """
    known: CalibrationModel | RobotModel | None = model if model is not None else calibration
    if known is None:
        raise InputError("C header: expected a robot, a calibration model, or both; got neither")
    notes: list[str] = []
    name = c_name("model" if model is None else model.name)
    quantities, functions = list[str](), list[str]()
    if model is not None:
        if loads is not None:
            model.require_inertia()
        elif not model.missing_tensor and not model.missing_inertia:
            loads = known_loads(model)
        if calibration is None:
            model.require_masses()
        if model.missing_inertia:
            notes.append(
                f'robot "{model.name}": no inertia for {", ".join(model.missing_inertia)}, so without gravity and '
                "regressor; the header holds the correction alone"
            )
        else:
            quantities, functions = c_gravity(model, name)
            if model.missing_tensor:
                notes.append(
                    f'robot "{model.name}": no possible inertia for {", ".join(model.missing_tensor)}, so gravity and '
                    "its regressors alone, without mass matrix, inverse dynamics and feedforward"
                )
            else:
                motion = c_motion(model, name, loads)
                notes += _without_memory(loads)
                quantities, functions = quantities + motion.text, functions + motion.names
    guard = f"CATENARY_{name.upper()}_H"
    what = "Calibration model" if model is None else f"Robot {c_comment(model.name)}"
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
        notes += [*_other_joints(known, calibration), *calibration.asked_of_reports]
    return Header("\n".join([*text, f"#endif /* {guard} */", ""]), tuple(functions), tuple(notes))


def _without_memory(loads: ActuationLoads | None) -> list[str]:
    """Return a note on friction that depends on what was before: a function of one instant does not know it."""
    names = [] if loads is None else [term.name for term in loads.terms if term.kind == "presliding"]
    if not names:
        return []
    return [f"presliding friction of {', '.join(names)} is written as in steady sliding, where it is Coulomb friction"]


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


def write_header(header: Header, path: Path) -> None:
    """Write a header to a file.

    Raises:
        FileFormatError: The file cannot be written.
    """
    write_atomically(path, header.text.encode("ascii"))


def _correction_comment(model: CalibrationModel, corrector: Corrector) -> str:
    n = len(model.joint_names)
    names = zip(model.features.signals, model.features.units, strict=True)
    signals = ", ".join(f"{c_comment(name)} [{c_comment(unit)}]" for name, unit in names)
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
            f"   To check, after reset: q = {c_values(q)}, signals = {c_values(x)}",
            f"   gives {c_values(out)}, inside {c_values(inside.astype(float))}. */",
        ]
    )


def _interval_comment(model: CalibrationModel) -> str:
    if model.intervals is None:
        return "   The model has no intervals: ..._interval(state) gives NAN."
    return (
        f"   ..._interval(state)[{len(model.joint_names)}]: half-widths of the last tick's intervals, which hold "
        f"{100.0 * model.intervals.level:g} per cent of errors."
    )


def _joints(names: tuple[str, ...], units: tuple[str, ...]) -> str:
    return ", ".join(f"{c_comment(name)} [{unit}]" for name, unit in zip(names, units, strict=True))
