"""The picture of teleop in a terminal: lines of a fixed size, 80 by 24 and up."""

from collections.abc import Sequence
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Bounded, JointState, OperatingState
from catenary.teleop.dead_man import RAMP, TIMEOUT
from catenary.teleop.motion import BACKWARD, FORWARD
from catenary.visible import visible

BAR = 20  # characters of a joint's range
_HELP = (
    "E enable  D disable  P pause  R resume  H H home  Space hold  + - speed",
    "arrows: tip along x, y   page up/down: along z   ? keys   Q quit (pauses)",
)
_MORE = (
    f"Hold a key to move; {TIMEOUT + RAMP:g} s after its last repeat everything has stopped.",
    "Lower case moves, capitals change the robot's state. H twice within 2 s homes.",
    "Ctrl-C and Q hold the robot, then pause it; Ctrl-Z holds it meanwhile.",
)


class View(NamedTuple):
    """The robot and the session as they are shown."""

    robot: str
    simulated: bool
    operating: OperatingState
    measured: JointState
    setpoint: Floats  # (n,) [rad|m]
    speed: float
    is_moving: bool
    blocked: Sequence[str]
    message: str
    joints: Bounded
    tip: Floats | None  # (3,) [m] in the base frame
    recording: str | None = None
    with_help: bool = False


def teleop_lines(view: View, columns: int = 80, lines: int = 24) -> list[str]:
    """Return exactly `lines` lines of at most `columns` characters."""
    state = view.operating
    what = "simulated" if view.simulated else "ROBOT"
    title = f"catenary teleop  {view.robot} ({what})  {state.state}{'' if state.is_homed else ', NOT HOMED'}"
    title += ", busy" if state.is_busy else ""
    shown = [title, f"speed x{view.speed:g}   {'moving' if view.is_moving else 'still'}", ""]
    shown.append(f"{'keys':>4}  {'joint':<18}{'now':>11}{'set':>11}   range")
    joints, lower, upper = view.joints, view.joints.lower, view.joints.upper
    for j, (name, unit) in enumerate(zip(joints.joint_names, joints.joint_units, strict=True)):
        keys = f"{FORWARD[j]} {BACKWARD[j]}" if j < len(FORWARD) else ""
        mark = " LIMIT" if name in view.blocked else ""
        shown.append(
            f"{keys:>4}  {name[:17]:<18}{_number(view.measured.q[j], unit):>11}{_number(view.setpoint[j], unit):>11}   "
            f"{_bar(view.setpoint[j], lower[j], upper[j])}{mark}"
        )
    if view.tip is not None:
        x, y, z = 1e3 * view.tip
        shown += ["", f"tip  x {x:8.1f}  y {y:8.1f}  z {z:8.1f} mm, in the base frame"]
    shown += ["", *wrap(visible(view.message), max(8, columns))]
    if view.recording is not None:
        shown.append(view.recording)
    footer = [*(_MORE if view.with_help else ()), *_HELP]
    room = max(0, lines - len(footer))
    shown = shown[:room] + [""] * (room - len(shown)) + footer[:lines]
    return [visible(line.replace("\n", " "))[:columns] for line in shown[:lines]]


def _number(value: float, unit: str) -> str:
    return f"{np.rad2deg(value):.2f} deg" if unit == "rad" else f"{1e3 * value:.2f} mm"


def _bar(value: float, low: float, high: float) -> str:
    if not (np.isfinite(low) and np.isfinite(high)):
        return "no limits"
    place = int(np.clip((value - low) / (high - low), 0.0, 1.0) * (BAR - 1) + 0.5)
    return "[" + "." * place + "#" + "." * (BAR - 1 - place) + "]"
