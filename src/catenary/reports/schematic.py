"""Schematic figures: a RAVEN-II's cables, its signals and control, the commands that drive it, a calibration model.

They follow figures 2 and 11, 12, 10, and 4 of Peng et al., *Efficient data-driven joint-level calibration of
cable-driven surgical robots*; their numbers are those of the robot's data file and of the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from catenary.calibration.model import CalibrationModel, JointGroup
from catenary.calibration.model_kinds import MODEL_KINDS
from catenary.calibration.predictors import Expansion, Network
from catenary.raven2.topics import EXT_JPOS, JOINTS, RAVENSTATE, STATE_COLUMNS
from catenary.raven2.transmission import COUNTS_PER_RADIAN
from catenary.reports.page import BLUE, GREY, ORANGE
from catenary.reports.robot_plot import ShownFigure
from catenary.simulation.cable_parameters import load_cable_arm

_COLUMN_INCH, _ROW_INCH, _BOX = 2.0, 0.95, (0.78, 0.7)  # a box's width and height, of a column and a row
_PASTEL = {"": "#eef1f6", "measured": "#f7dfd2", "true": "#dcefe3"}  # fill of a box by what it holds
_TRUE, _MOST_LETTERS = "#2a7f4f", 24  # of names in a line of a box
_LEGEND_SIZE, _TEXT_SIZE, _SMALL_SIZE = 8.0, 7.5, 6.5


class DiagramBox(NamedTuple):
    """A box of a diagram: its place in columns and rows from the upper left, its text, and what it holds."""

    column: float
    row: float
    text: str
    holds: str = ""  # a key of the legend: "measured" directly, the "true" position, or "" of all others


def diagram(title: str, boxes: Mapping[str, DiagramBox], arrows: Sequence[tuple[str, str, str]]) -> Figure:
    """Draw boxes, and arrows from one to another with a text; arrows leave and enter by the nearest sides."""
    width, height = (max(getattr(box, way) for box in boxes.values()) + 1.0 for way in ("column", "row"))
    figure = ShownFigure(figsize=(_COLUMN_INCH * width, _ROW_INCH * height + 0.4), layout="constrained")
    axes = figure.add_subplot(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set_axis_off()
    axes.set_title(title, fontsize=10, loc="left")
    for box in boxes.values():
        corner = box.column - 0.5 * _BOX[0], box.row - 0.5 * _BOX[1]
        style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.06", "edgecolor": BLUE, "linewidth": 0.9}
        axes.add_patch(FancyBboxPatch(corner, *_BOX, facecolor=_PASTEL[box.holds], **style))
        axes.text(box.column, box.row, box.text, ha="center", va="center", fontsize=_TEXT_SIZE, linespacing=1.25)
    for start, end, text in arrows:
        a, b = boxes[start], boxes[end]
        across, along = b.column - a.column, b.row - a.row
        if abs(across) >= 0.9:  # from side to side
            side = 0.5 * _BOX[0] * math.copysign(1.0, across)
            ends = (a.column + side, a.row), (b.column - side, b.row)
        else:
            side = 0.5 * _BOX[1] * math.copysign(1.0, along)
            ends = (a.column, a.row + side), (b.column, b.row - side)
        style = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", ends[1], ends[0], arrowprops=style)
        x, y = (0.5 * (one + other) for one, other in zip(*ends, strict=True))
        back = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
        place = "bottom" if along == 0.0 else "center"  # above a level arrow
        axes.text(x, y - 0.03, text, ha="center", va=place, fontsize=_SMALL_SIZE, color=ORANGE, bbox=back)
    return figure


def _cables() -> Figure:
    """Draw each joint's cable from its motor at the base past the joints that it is led over, and the encoders."""
    arm = load_cable_arm()
    firmware, rig = arm.firmware, arm.rig
    coupling = dict(zip(((1, 0), (2, 0), (2, 1)), firmware.coupling, strict=True))
    n = len(JOINTS)
    figure = ShownFigure(figsize=(11.0, 4.6), layout="constrained")
    axes = figure.add_subplot(xlim=(-1.9, n + 1.4), ylim=(n - 0.3, -1.3))
    axes.set_axis_off()
    axes.set_title("RAVEN-II: joints and cables, motors and their encoders on the base", fontsize=10, loc="left")
    for j, joint in enumerate(JOINTS):
        axes.axvline(j + 1.0, color=GREY, linewidth=0.8, zorder=0)
        axes.text(j + 1.0, -0.85, f"{j + 1} {joint}", ha="center", fontsize=_LEGEND_SIZE)
        axes.plot([-0.35, j + 1.0], [j, j], color=BLUE, linewidth=1.6, zorder=1)
        axes.plot([-0.35], [j], "s", color=BLUE, markersize=11)
        slides = joint == "insertion"
        moves = f"{1e-3 * firmware.ratio[j]:.4g} rad to 1 mm" if slides else f"{firmware.ratio[j]:.4g} turns to 1"
        text = f"motor {j + 1}, gear {firmware.gearbox[j]:.4g}:1\n{moves}"
        axes.text(-0.6, j, text, ha="right", va="center", fontsize=_SMALL_SIZE)
        for i in range(j):
            axes.plot([i + 1.0], [j], "o", color="white", markeredgecolor=BLUE, markersize=6)
            if (j, i) in coupling:
                c = coupling[j, i]
                text = f"{1e3 * c:.2f} mm/rad" if slides else f"{c:.3f} rad/rad"
                axes.text(i + 1.06, j - 0.14, text, fontsize=_SMALL_SIZE, color=BLUE, va="bottom")
        axes.plot([j + 1.0], [j], "o", color=ORANGE, markersize=9)
        if j < len(rig.counts):
            text = f"{1e6 / rig.counts[j]:.0f} µm" if slides else f"{2.0 * math.pi * rig.counts[j]:,.0f} counts a turn"
            axes.plot([j + 1.22], [j], "D", color=_TRUE, markersize=7)
            axes.text(j + 1.34, j, text, fontsize=_SMALL_SIZE, color=_TRUE, va="center")
    for marker, color, label in (
        ("s", BLUE, f"motor with its encoder, {COUNTS_PER_RADIAN * 2.0 * math.pi:.0f} counts a turn"),
        ("o", "white", "led over another joint; what it moves by is written beside"),
        ("o", ORANGE, "end of the cable, at its joint"),
        ("D", _TRUE, "external encoder, taken off after training"),
    ):
        axes.plot([], [], marker, color=color, markeredgecolor=BLUE if color == "white" else color, label=label)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.12), ncols=4, frameon=False, fontsize=_SMALL_SIZE)
    return figure


def _signals() -> Figure:
    """Draw a RAVEN-II's signals from command to joint and back, by their names in raven_state."""
    firmware = load_cable_arm().firmware

    def named(*fields: str) -> str:
        return ", ".join(STATE_COLUMNS[field].name for field in fields)

    gains = f"Kp {firmware.kp[0]:g}, Kd {firmware.kd[0]:g}, Ki {firmware.ki[0]:g}"
    boxes = {
        "tip": DiagramBox(0, 0, f"command in space\n{named('pos_d', 'ori_d')}"),
        "jd": DiagramBox(1, 0, f"desired joints\n{named('jpos_d')}"),
        "md": DiagramBox(2, 0, f"desired motors\n{named('mpos_d')}"),
        "pd": DiagramBox(3, 0, f"PD at 1 kHz, joint 1:\n{gains}"),
        "tau": DiagramBox(4, 0, f"torque, a command\n{named('tau')}"),
        "dac": DiagramBox(5, 0, f"current, a command\n{named('dac_val')}"),
        "motor": DiagramBox(5, 1, "motors, gears,\ncables"),
        "encoder": DiagramBox(4, 2, f"motors' encoders\n{named('encVals')}", "measured"),
        "m": DiagramBox(3, 2, f"motor positions\n{named('mpos', 'mvel')}"),
        "j": DiagramBox(2, 2, f"reported joints\n{named('jpos', 'jvel')}"),
        "pose": DiagramBox(0, 2, f"tool's pose\n{named('pos', 'ori')}"),
        "joint": DiagramBox(5, 2, "joints"),
        "ext": DiagramBox(5, 3, f"external encoders\n{EXT_JPOS.name.strip('/')}", "true"),
        "model": DiagramBox(3, 3, "calibration\nq + f(q, tau)"),
        "calibrated": DiagramBox(2, 3, "calibrated joints"),
    }
    arrows = [
        ("tip", "jd", "inverse"), ("jd", "md", "ratio,\ncoupling"), ("md", "pd", ""), ("m", "pd", "fed back"),
        ("pd", "tau", ""), ("tau", "dac", "1/Kt"), ("dac", "motor", ""), ("motor", "joint", "stretch, friction"),
        ("motor", "encoder", "shafts"), ("encoder", "m", "offset"), ("m", "j", "ratio,\ncoupling"),
        ("j", "pose", "kinematics"), ("joint", "ext", ""), ("ext", "model", "in training only"),
        ("j", "model", "and tau"), ("model", "calibrated", ""),
    ]  # fmt: skip
    return diagram(
        f"RAVEN-II: {RAVENSTATE.type.rpartition('/')[2]} and its control; orange: measured, green: true", boxes, arrows
    )


def _commands() -> Figure:
    """Draw the commands that drive and watch a robot, and the topics between them and it."""
    drive = {"teleop": "keyboard", "goto": "go to a place", "random": "random motion", "follow": "rows of a file"}
    watch = {
        "record": "motion and recorder",
        "monitor": "state in a terminal",
        "view": "arm in a browser",
        "deploy": "corrected joints",
    }
    boxes = {name: DiagramBox(0, k, f"catenary {name}\n{what}") for k, (name, what) in enumerate(drive.items())}
    boxes |= {name: DiagramBox(4, k, f"catenary {name}\n{what}") for k, (name, what) in enumerate(watch.items())}
    boxes |= {
        "client": DiagramBox(1, 1.5, "CRTK client: limits,\none program at a time"),
        "robot": DiagramBox(2, 0.5, "robot, or\ncatenary serve"),
        "states": DiagramBox(2, 2.5, "measured_js,\nsetpoint_js,\noperating_state", "measured"),
        "reader": DiagramBox(3, 1.5, "CRTK reader:\nclock, units, stops"),
    }
    arrows = [
        *((name, "client", "") for name in drive), ("client", "robot", "servo_jr, move_jp,\nstate_command"),
        ("robot", "states", "ROS 1 or 2"), ("states", "client", ""), ("states", "reader", ""),
        *(("reader", name, "") for name in watch),
    ]  # fmt: skip
    return diagram("Commands that drive and watch a robot over CRTK", boxes, arrows)


SCHEMATICS: Mapping[str, Callable[[], Figure]] = {"cables": _cables, "signals": _signals, "commands": _commands}


def model_schematic(model: CalibrationModel) -> Figure:
    """Draw from which inputs a calibration model computes the joints' errors, and where they are added."""
    inputs: dict[str, list[str]] = {}
    for signal in model.features.signals:
        kind, _, name = signal.partition(":")
        inputs.setdefault(kind, []).append(name or kind)
    rows = max(len(inputs), len(model.groups))
    boxes = {"reported": DiagramBox(0, 0, "reported joints")}
    boxes |= {kind: DiagramBox(0, k, f"{kind}\n{_listed(names)}") for k, (kind, names) in enumerate(inputs.items(), 1)}
    for k, group in enumerate(model.groups):
        joints = _listed([model.joint_names[j] for j in group.joints])
        row = 1.0 + (k + 0.5) * rows / len(model.groups) - 0.5
        boxes[f"group {k}"] = DiagramBox(1.3, row, f"{joints}\n{_formula(model, group)}")
    middle = 0.5 * (1.0 + rows)
    boxes["added"] = DiagramBox(
        2.6, middle, f"{model.target}, where inputs are\nin the valid range;\nelse fixed offset"
    )
    boxes["calibrated"] = DiagramBox(
        3.8, 0.0, "calibrated joints" + ("\n± interval" if model.intervals else ""), "true"
    )
    arrows = [(kind, f"group {k}", "") for kind in inputs for k in range(len(model.groups))]
    arrows += [(f"group {k}", "added", "") for k in range(len(model.groups))]
    adds = model.target == "error"  # end to end a model gives the position itself
    arrows += [("reported", "calibrated", "")] * adds + [("added", "calibrated", "+" * adds)]
    says = MODEL_KINDS[model.kind].words if model.kind in MODEL_KINDS else ""
    return diagram(f"Calibration model: {model.kind}, {says}", boxes, arrows)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(", ".join(names)) <= _MOST_LETTERS else f"{names[0]} to {names[-1]} ({len(names)})"


def _formula(model: CalibrationModel, group: JointGroup) -> str:
    """Return in two lines what a predictor computes from which inputs."""
    predictor, inputs = group.predictor, [model.features.names[column] for column in group.columns]
    signals = sum(name in model.features.signals for name in inputs)
    taken = f"{signals} signals" + f", {len(inputs) - signals} states" * (signals < len(inputs))
    if isinstance(predictor, Network):
        widths = [len(inputs), *(len(bias) for bias in predictor.biases)]
        return f"{predictor.activation} network\n{'-'.join(map(str, widths))}"
    if isinstance(predictor, Expansion):
        name = "A x + b" if predictor.penalties is None else "ridge regression"
        terms = len(predictor.terms)
        return f"{name}\n{taken}" + f"\n{terms} terms" * (terms > len(inputs))
    return taken
