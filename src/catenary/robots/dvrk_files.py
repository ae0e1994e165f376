"""The dVRK's own files of an arm, in JSON: its kinematics, its instrument's, and its configuration, which names both.

Both are DH tables [jhu-dvrk/sawIntuitiveResearchKit, share/kinematic and share/tool]: an instrument's rows stand behind
those of a PSM. A joint's `offset` adds to theta or D. Instruments differ in their shafts, .4162 m of the classic ones
(models 400...), .4670 m of S and Si (420...), for which a PSM_Si stands 50.8 mm farther back than a PSM. Rows are in
the joints that measured_js reports: `coupling`, from the motors to them, is no part of it.
"""

import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AliasChoices, Field

from catenary.config import Recorded, parse_settings
from catenary.documents import MOST_JSON, cut, json_table, read_bounded, without_comments
from catenary.errors import FileFormatError, UnsupportedModelError
from catenary.plant import nameless
from catenary.robots.assembly import file_source, left_out, naming_the_file
from catenary.robots.dh_table import RobotTable, robot_of_table
from catenary.robots.model import Massless, RobotModel

TOOL = "tool"  # the frame of tooltip_offset
_MODEL = re.compile(r":(\d+)(\[.*\])?\Z")  # of an instrument, "LARGE_NEEDLE_DRIVER:420006[1]"
_NEAR = 4  # folders above an arm's file, beside which the files that it names may stand
_SHORT = 1e-4  # by which numbers of four digits leave a matrix no rotation

_Row = Annotated[tuple[float, ...], Field(min_length=4, max_length=4)]
_Matrix = Annotated[tuple[_Row, ...], Field(min_length=4, max_length=4)]


class _DvrkJoint(Recorded):
    """A row of the table: lengths in m, angles in rad."""

    name: str = ""
    type: Literal["revolute", "prismatic"]
    mode: str = "active"
    alpha: float
    a: Annotated[float, Field(alias="A")]
    theta: float = 0.0
    d: Annotated[float, Field(alias="D")] = 0.0
    offset: float = 0.0
    convention: Literal["modified", "standard"] | None = None  # of older files, in each row
    qmin: float | None = None
    qmax: float | None = None
    ftmax: float | None = None  # [Nm or N]
    mass: float = 0.0


class _Table(Recorded):
    convention: Literal["modified", "standard"] | None = None
    joints: Annotated[
        tuple[_DvrkJoint, ...], Field(min_length=1, max_length=64, validation_alias=AliasChoices("joints", "links"))
    ]


class _Kinematics(Recorded):
    dh: Annotated[_Table, Field(alias="DH")]
    snake_like: Annotated[bool, Field(alias="snake-like")] = False
    base: Annotated[_Matrix | None, Field(validation_alias=AliasChoices("base-offset", "base_offset"))] = None
    tooltip: Annotated[_Matrix | None, Field(validation_alias=AliasChoices("tooltip_offset", "tooltip-offset"))] = None


class _Arm(Recorded):
    """An arm's configuration; without a fixed instrument it is the arm without any."""

    kinematic: str
    tool: str | None = None
    base: Annotated[_Matrix | None, Field(validation_alias=AliasChoices("base-offset", "base_offset"))] = None


def load_dvrk(path: Path, *, instrument: Path | None = None, massless: Massless = ()) -> RobotModel:
    """Load an arm of a da Vinci from a file of the dVRK.

    Args:
        path: Kinematics of an arm (kinematic/PSM.json), or the configuration that names them (arm/..., PSM1.json).
        instrument: Kinematics of its instrument (tool/LARGE_NEEDLE_DRIVER_420006.json); the configuration's when None.
        massless: As of `load_robot`.

    Raises:
        FileFormatError: A file is missing, no JSON, or none of the dVRK's kinematics.
        UnsupportedModelError: Rows follow others by rules that stand in the dVRK's program and not in the file.
    """
    content, source = _read(path)
    base = None
    if "kinematic" in content:
        arm = parse_settings(content, _Arm, str(path))
        base = arm.base
        if arm.tool is not None and instrument is None:
            instrument = _beside(path, "tool/" + _MODEL.sub(r"_\1", arm.tool) + ".json")
        path = _beside(path, arm.kinematic)
        content, source = _read(path)
    parts, files, sources = [_kinematics(path, content)], [path], [source]
    if parts[0].tooltip is not None and len(parts[0].dh.joints) < 6:
        raise FileFormatError(
            f"{path}: is an instrument of the dVRK, whose arm it does not state; expected the arm's kinematics "
            '(PSM.json, PSM_Si.json), an arm\'s configuration that names both, or a TOML with description = "PSM.json" '
            f'and instrument = "{cut(path.name)}"'
        )
    if instrument is not None:
        content, source = _read(instrument)
        parts, files, sources = [*parts, _kinematics(instrument, content)], [*files, instrument], [*sources, source]
    rows = [(part.dh.convention, joint) for part in parts for joint in part.dh.joints]
    conventions = {joint.convention or convention for convention, joint in rows}
    if len(conventions) != 1 or None in conventions:
        raise FileFormatError(f"{path}: convention: expected modified or standard, the same in all rows")
    joints = [joint for _, joint in rows]
    names = [joint.name or plain for joint, plain in zip(joints, nameless(len(joints)), strict=True)]
    weighed = [name for name, joint in zip(names, joints, strict=True) if joint.mass]
    table: dict[str, Any] = {
        "name": "_".join(file.stem for file in files),
        "convention": conventions.pop(),
        "sources": [*sources, *left_out("masses, which not all links have", weighed)],
        "link": [_link(name, joint) for name, joint in zip(names, joints, strict=True)],
    }
    base = base if base is not None else parts[0].base
    where = ", ".join(map(str, files))
    if base is not None:
        rotation, position = _pose(f"{where}: base offset", base)
        table |= {"base_rotation": rotation, "base_position_m": position}
    if parts[-1].tooltip is not None:
        rotation, position = _pose(f"{where}: tooltip_offset", parts[-1].tooltip)
        table["frame"] = [{"name": TOOL, "link": names[-1], "position_m": position, "rotation": rotation}]
        table["tip"] = TOOL
    with naming_the_file(where):
        return robot_of_table(where, parse_settings(table, RobotTable, where), massless)


def _read(path: Path) -> tuple[dict[str, Any], str]:
    """Return what a file holds, and the line by which it is told from another version."""
    data = read_bounded(path, MOST_JSON)
    return json_table(without_comments(data), str(path)), file_source(path, data)


def _kinematics(path: Path, content: dict[str, Any]) -> _Kinematics:
    if "DH" not in content:
        raise FileFormatError(
            f"{path}: is no robot of the dVRK: expected kinematics with DH (share/kinematic, share/tool), or an arm's "
            f"configuration with kinematic (share/arm), got {', '.join(map(cut, list(content)[:8])) or 'nothing'}"
        )
    found = parse_settings(content, _Kinematics, str(path))
    passive = [joint.name for joint in found.dh.joints if joint.mode != "active"]
    if found.snake_like or passive:
        why = f"joint {cut(passive[0])} is passive" if passive else "its wrist is a snake's"
        raise UnsupportedModelError(
            f"{path}: {why}: how its rows follow the joints stands in the dVRK's program, not in the file"
            + ("; for kinematics take PSM_Si.json or ECM_Si.json" if passive else "")
        )
    return found


def _beside(path: Path, named: str) -> Path:
    """Return a file that an arm's configuration names, in the folders that the dVRK looks through: those above it."""
    if not (Path(named).is_absolute() or ".." in Path(named).parts):
        for folder in list(path.absolute().parents)[:_NEAR]:
            if (folder / named).is_file():
                return folder / named
    raise FileFormatError(f"{path}: names {cut(named)}: expected it beside it, or below a folder that it lies in")


def _link(name: str, joint: _DvrkJoint) -> dict[str, Any]:
    turns = joint.type == "revolute"
    own: dict[str, Any] = {} if joint.ftmax is None else {"effort_nm" if turns else "effort_n": joint.ftmax}
    if joint.qmin is not None and joint.qmax is not None:
        limits = np.array([joint.qmin, joint.qmax])
        own |= {"limits_deg": np.rad2deg(limits).tolist()} if turns else {"limits_m": limits.tolist()}
    return {
        "name": name,
        "joint": joint.type,
        "alpha_deg": float(np.rad2deg(joint.alpha)),
        "a_m": joint.a,
        "theta_deg": float(np.rad2deg(joint.theta + (joint.offset if turns else 0.0))),
        "d_m": joint.d + (0.0 if turns else joint.offset),
        **own,
    }


def _pose(where: str, matrix: _Matrix) -> tuple[list[list[float]], list[float]]:
    """Return the rotation next to a matrix of four digits, and the position [m]."""
    given = np.array(matrix)
    u, _, v = np.linalg.svd(given[:3, :3])
    if not np.abs(u @ v - given[:3, :3]).max() < _SHORT or np.linalg.det(u @ v) < 0.0:
        raise FileFormatError(f"{where}: expected a rotation and a position, got {given[:3, :3].tolist()}")
    return (u @ v).tolist(), given[:3, 3].tolist()
