"""A mapping: which columns of a recording are which quantity, and in which units; TOML, or options of a command."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from catenary.arrays import Floats
from catenary.bounded_parsers import cut
from catenary.config import Settings, load_toml, parse_settings
from catenary.errors import ConfigError
from catenary.recording.import_formats.table_time import TimeUnit
from catenary.spatial import Pose, rotation_from_quaternion
from catenary.units import TO_SI
from catenary.verdict.corrections import clock_of

Unit = Literal["rad", "deg", "m", "cm", "mm", "counts"]
SI = {unit: TO_SI[unit] for unit in ("rad", "deg", "m", "cm", "mm")}
JOINT_QUANTITIES = ("q_nominal", "q_encoder", "q_reported", "qd", "tau")
_LEAST_DETERMINANT = 1e-9  # of a coupling in SI
_OPTION = re.compile(r"(?P<quantity>[a-z_]+)(?::(?P<signal>[^=]+))?=(?P<columns>.+)\Z", re.DOTALL)


def _listed(value: object) -> object:
    """Let one stand for a list of one."""
    if isinstance(value, list):
        return tuple(value)
    return (value,) if isinstance(value, str | int | float) and not isinstance(value, bool) else value


Texts = Annotated[tuple[str, ...], BeforeValidator(_listed)]
Numbers = Annotated[tuple[float, ...], BeforeValidator(_listed)]
Units = Annotated[tuple[Unit, ...], BeforeValidator(_listed)]


class Transform(Settings):
    """Pose of a frame b in a frame a."""

    position_m: Annotated[tuple[float, ...], Field(min_length=3, max_length=3)] = (0.0, 0.0, 0.0)
    quaternion_wxyz: Annotated[tuple[float, ...], Field(min_length=4, max_length=4)] = (1.0, 0.0, 0.0, 0.0)

    def pose(self) -> Pose:
        """Return the pose in SI."""
        return Pose(rotation_from_quaternion(self.quaternion_wxyz), np.array(self.position_m))


class TrackedPose(Settings):
    """Pose of a marker in a tracker's frame, or its position alone, from which joints follow by inverse kinematics."""

    # a message's pose, transform or point, such as "/tracker/pose.pose", a tracker's body; or columns: position x y z
    # alone, or with a quaternion (7) or three angles (6)
    columns: Texts
    unit: Literal["m", "cm", "mm"] = "m"
    # of the columns behind the position: a quaternion; axis times angle; or turns about axes in this order, capitals
    # about the axes that turn with it ("ZYX" is yaw, pitch, roll), small letters about fixed ones
    orientation: Annotated[str, Field(pattern="^(xyzw|wxyz|vector|[xyz]{3}|[XYZ]{3})$")] = "xyzw"
    angle_unit: Literal["rad", "deg"] = "rad"
    frame: str | None = None  # of the robot; its tip when None
    match: Literal["pose", "position"] = "position"
    # how far from a pose the nearest joints may leave the frame: noise, or an arm with fewer than six joints
    within_mm: Annotated[float, Field(gt=0.0)] = 1.0
    within_deg: Annotated[float, Field(gt=0.0)] = 1.0
    zeros: Literal["free", "held"] = "free"  # of the joints, where the transforms are found; held, they are right
    # found from the recording (registration.py) where not given
    T_base_tracker: Transform | None = None  # the tracker's frame in the robot's base
    T_marker_frame: Transform | None = None  # the robot's frame in the marker's; in its own axes if only a position is

    @model_validator(mode="after")
    def _three_turns(self) -> "TrackedPose":
        if any(first == second for first, second in pairwise(self.orientation)):
            raise ValueError(f"orientation {self.orientation}: turns twice about one axis")
        return self


class Quantity(Settings):
    """Columns of one quantity, in the order of the joints."""

    columns: Texts = ()
    units: Units = ()  # one for all, or one per joint; of qd per second
    scale: Numbers = ()  # rad or m per count; of tau Nm or N per unit; of others a factor
    sign: Numbers = ()
    # A matrix (n, n) of joint positions by those of the motors, where columns are the motors': q = A m, qd = A qd_m,
    # tau = A^-T tau_m; or of tau c01, c02, c12 of the cables (transmission/cable_elasticity.py), from drums to joints
    coupling: tuple[tuple[float, ...], ...] | Annotated[tuple[float, ...], Field(min_length=3, max_length=3)] | None = (
        None
    )
    optional: bool = False  # left out of the log where the recording has none of it
    pose: TrackedPose | None = None  # of q_encoder, in place of columns

    @model_validator(mode="after")
    def _checked(self) -> "Quantity":
        if bool(self.columns) == (self.pose is not None):
            raise ValueError("expected columns, or a pose")
        if not {*self.sign} <= {-1.0, 1.0} or 0.0 in self.scale:
            raise ValueError("expected a sign of 1 or -1 for each joint, and no scale of 0")
        matrix = self.coupling_matrix
        if matrix is not None and abs(np.linalg.det(matrix)) < _LEAST_DETERMINANT:
            raise ValueError(f"coupling: expected a matrix (n, n) that has an inverse, got {matrix.tolist()}")
        return self

    @property
    def coupling_matrix(self) -> Floats | None:
        """The coupling (n, n) of joints by motors; None without one, and of that of drums."""
        if self.coupling is None or not isinstance(self.coupling[0], tuple):
            return None
        if {len(row) for row in self.coupling if isinstance(row, tuple)} != {len(self.coupling)}:
            raise ValueError(f"coupling: expected as many columns as its {len(self.coupling)} rows")
        return np.array(self.coupling, dtype=np.float64)


class Signal(Settings):
    """A further column."""

    columns: Texts
    units: str = ""
    scale: float = 1.0
    optional: bool = False  # left out of the log where the recording has none of it


class RecordingMapping(Settings):
    """Columns of a recording for each quantity; see docs/how-to-bring-your-recordings.md."""

    q_nominal: Quantity
    q_encoder: Quantity | None = None
    q_reported: Quantity | None = None  # what the robot reports, where q_nominal is a setpoint
    qd: Quantity | None = None
    tau: Quantity | None = None
    ok: Texts = ()  # columns that are not 0 where q_encoder can be trusted
    signals: dict[str, Signal] = Field(default_factory=dict)
    robot: str | None = None  # catalogue name or file
    default_robot: str | None = None  # that the log is of, where neither `robot` nor the recording says it
    name: str = ""  # of a layout that needs no mapping from its reader
    joint_names: Texts = ()
    joint_units: Annotated[tuple[Literal["rad", "m"], ...], BeforeValidator(_listed)] = ()
    names_in: str | None = None  # array of texts in a file that holds the joints' names, where it has one
    units_in: str | None = None  # and their units
    assumed_units: tuple[tuple[Literal["rad", "m"], ...], ...] = ()  # by the number of joints, where nobody says them
    reported: Texts = ()  # topics whose rates and gaps are only reported
    stamps: Literal["auto", "header", "arrival"] = "auto"  # of messages
    time: Texts = ()  # column of a table; of several tables, one for each
    time_unit: TimeUnit | None = None
    time_zero: Literal["first row", "file"] = "first row"  # where the log's time begins; the file's own zero
    unsettled: Texts = ()  # mends that recordings of this layout may still need: "units", "time_unit"
    rate_hz: Annotated[float, Field(gt=0.0)] | None = None  # of a table without time
    # "0.73,50": by how many seconds the clock of files beside q_nominal's is ahead at first, and how many ppm it gains;
    # "cam.csv=0.73,50" of one
    clock: Texts = ()
    max_gap_s: Annotated[float, Field(gt=0.0)] = 0.05  # between samples that are interpolated between

    @model_validator(mode="after")
    def _measured_or_given(self) -> "RecordingMapping":
        for name in JOINT_QUANTITIES:
            quantity = getattr(self, name)
            of_drums = quantity is not None and quantity.coupling is not None and quantity.coupling_matrix is None
            if name != "tau" and of_drums:
                raise ValueError(f"{name}: a coupling of drums is of tau alone; expected a matrix (n, n)")
            if name != "q_encoder" and quantity is not None and quantity.pose is not None:
                raise ValueError(f"{name}: a pose gives q_encoder alone")
        if self.q_encoder is not None and self.q_encoder.pose is not None and self.robot is None:
            raise ValueError("q_encoder from a pose needs robot, whose inverse kinematics it takes")
        return self

    @property
    def clocks(self) -> dict[str, tuple[float, float]]:
        """Return offset [s] and drift of each file's clock; "" stands for any other file."""
        return {name: clock_of(text) for name, _, text in (clock.rpartition("=") for clock in self.clock)}


def layout_mapping(layout: str, **words: Any) -> RecordingMapping:
    """Return the mapping of a layout, ROOM/NAME for catenary/ROOM/data/NAME.toml, its words in braces filled in."""
    room, _, name = layout.partition("/")
    text = (files("catenary") / room / "data" / f"{name}.toml").read_text("utf-8")
    for word, value in words.items():
        text = text.replace(f"{{{word}}}", value if isinstance(value, str) else repr(value))
    return parse_settings(tomllib.loads(text), RecordingMapping, f"{name}.toml")


def mapping_of(
    options: Sequence[str],
    *,
    file: Path | None = None,
    content: Mapping[str, Any] | None = None,
    units: str | None = None,
    settings: Mapping[str, object] | None = None,
) -> RecordingMapping | None:
    """Return the mapping that options give, on top of a file's, or of its content; None if there is none of them.

    Args:
        options: Such as "q_nominal=/raven/joint_cmd.position", "q_encoder=a,b,-c@deg,deg,mm", "ok=valid", "time=t@ms"
            or "signal:force=/ati.wrench.force.x@N". A minus reverses a column; units follow an @.
        file: TOML file of a mapping.
        content: Its content, in place of a file.
        units: Units of the joints, one or one per joint, of options that have none.
        settings: Further keys, such as robot; None is left out.

    Raises:
        ConfigError: The mapping is none.
    """
    own = {key: value for key, value in (settings or {}).items() if value is not None}
    if not options and file is None and content is None:
        return None
    of_file = load_toml(file, RecordingMapping).model_dump(mode="json", exclude_unset=True) if file else {}
    if questions := re.findall(r"# OPEN: (.*)", file.read_text("utf-8")) if file else []:
        raise ConfigError(f"{file}: still OPEN: {cut(questions[0])}: answer it there, then delete the marks OPEN")
    content = of_file or dict(content or {})
    for option in options:
        _take(option, content)
    for name in JOINT_QUANTITIES[:4] if units else ():
        quantity = content.get(name)
        if isinstance(quantity, dict) and not quantity.get("units") and not quantity.get("pose"):
            content[name] = {**quantity, "units": words_of(units)}
    where = str(file) if file is not None else "--map" if options else "mapping"
    return parse_settings({**content, **own}, RecordingMapping, where)


def words_of(text: str | None) -> list[str]:
    """Return the comma-separated words of a text."""
    return [word.strip() for word in (text or "").split(",") if word.strip()]


def _take(option: str, content: dict[str, Any]) -> None:
    match = _OPTION.match(option)
    names = (*JOINT_QUANTITIES, "ok", "time", "signal:NAME")
    if match is None:
        raise ConfigError(f"--map {cut(option)}: expected QUANTITY=COLUMNS, QUANTITY one of {', '.join(names)}")
    quantity, text = match["quantity"], match["columns"]
    columns, _, units = text.rpartition("@") if "@" in text else (text, "", "")
    listed = words_of(columns)
    if quantity == "signal" and match["signal"]:
        content.setdefault("signals", {})[match["signal"].strip()] = {"columns": listed, "units": units}
    elif quantity in JOINT_QUANTITIES:
        content[quantity] = {"columns": listed, **_units_and_scales(option, units)}
    elif quantity in ("ok", "time"):
        content |= {quantity: listed} | ({"time_unit": units} if quantity == "time" and units else {})
    else:
        raise ConfigError(f"--map {cut(option)}: no quantity {cut(quantity)}; expected one of {', '.join(names)}")


def _units_and_scales(option: str, text: str) -> dict[str, list[str] | list[float]]:
    """Read units such as "deg,deg,mm" or "counts*1.5e-4"."""
    if not text:
        return {}
    units, scales = [], []
    for part in text.split(","):
        unit, _, scale = part.partition("*")
        units.append(unit.strip())
        try:
            scales.append(float(scale) if scale else 1.0)
        except ValueError:
            raise ConfigError(f"--map {cut(option)}: scale {cut(scale)}: expected a number") from None
    return {"units": [u for u in units if u], **({"scale": scales} if "*" in text else {})}
