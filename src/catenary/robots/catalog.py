"""Robots by name, or from a file: TOML tables, URDF, MJCF, and what was identified."""

import logging
from difflib import get_close_matches
from importlib import import_module
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from pathlib import Path

from catenary.bounded_parsers import MAX_XML_BYTES, cut, read_bounded, xml_root_tag
from catenary.errors import FileFormatError, InputError
from catenary.robots.model import Massless, RobotModel

# by ending, or XML's root; each is imported when its file comes: a table needs neither an XML nor a MuJoCo reader
_READERS = {
    ".toml": ("dh_table", "load_table"), ".npz": ("model_record", "load_identified"),
    ".json": ("dvrk_files", "load_dvrk"),
    "<robot>": ("urdf", "load_urdf"), "<mujoco>": ("mjcf", "load_mjcf"),
}  # fmt: skip
_log = logging.getLogger(__name__)
_DATA = files("catenary.robots") / "data"
RAVEN_SIDES = {"raven2": "left", "raven2_right": "right"}  # which arm of a RAVEN-II a robot is


def robot_names() -> tuple[str, ...]:
    """Return the names of the robots that come with the package."""
    return tuple(sorted(p.name.removesuffix(".toml") for p in _DATA.iterdir() if p.name.endswith(".toml")))


def catalogue_file(name: str) -> Traversable:
    """Return the table of a robot that comes with the package."""
    return _DATA / f"{name}.toml"


def load_robot(source: str | Path, *, massless: Massless = (), strict: bool = False) -> RobotModel:
    """Load a robot by catalogue name, from a file, or from the text of a URDF.

    Args:
        source: Name in the catalogue, or path of a `.toml` table, `.urdf`, MJCF (`.xml`, `.mjcf`), the
            dVRK's `.json` or the `.npz` that identification wrote, or URDF itself, as ROS has it in
            `robot_description`.
        massless: Links that have no inertia in the file and are meant to have none; "all" for all such.
        strict: Refuse what is doubtful: inertias that no body has, masses of zero, lengths that no arm has. Otherwise
            the model names them in `doubts`, they are logged, and what would be wrong with them is refused when it is
            asked for.

    Raises:
        FileFormatError: Unknown name, missing file, or a file of another kind.
        InputError: `massless` names a link that does not exist or has a mass; strict, and the model has doubts.
        UnsupportedModelError: The file holds what a tree of one-coordinate joints cannot represent, such as a loop
            whose joints do not follow its motors linearly (`load_closed_robot`).

    Examples:
        >>> arm = catenary.load_robot("dvrk_psm")
        >>> arm.joint_names
        ('outer_yaw', 'outer_pitch', 'outer_insertion', 'outer_roll', 'outer_wrist_pitch', 'outer_wrist_yaw')
    """
    name = str(source)
    if isinstance(source, str) and source.lstrip().startswith("<"):
        model = load_text(source, massless=massless)
    elif name in robot_names():
        with as_file(catalogue_file(name)) as table:
            model = load_open(table, massless=massless)
    elif _is_file(Path(source)):
        model = load_open(Path(source), massless=massless)
    else:
        begins = [known for known in robot_names() if name.startswith(known)]
        close = begins[-1:] or get_close_matches(cut(name), robot_names(), n=1, cutoff=0.6)
        hint = f' (did you mean "{close[0]}"?)' if close else ""
        raise FileFormatError(
            f'robot "{cut(name)}": neither a file nor in the catalogue{hint}; '
            f"the catalogue has {', '.join(robot_names())}"
        )
    if model.loops is not None:
        from catenary.robots.loops import close_loops

        model = close_loops(model)
    if model.file_order not in ((), model.joint_names):  # unnamed numbers would land on other joints
        order = "depth first from the base, not as the file lists them"
        _log.warning('robot "%s": its joints are in the order %s: %s', model.name, ", ".join(model.joint_names), order)
    if strict and model.doubts:
        raise InputError(f'robot "{model.name}": {"; ".join(model.doubts)}')
    return model


def load_open(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from a `.toml`, `.urdf`, `.xml` (URDF or MJCF), `.mjcf`, `.json` or `.npz` file, its loops open.

    Args:
        path: Description file or table.
        massless: Links that may have no mass.

    Raises:
        InputError: As of `load_robot`.
    """
    kind = path.suffix.lower()
    if kind == ".toml":
        from catenary.robots.dh_table import as_described, described_table, description_of

        if (described := described_table(path)) is not None:
            description, chosen = description_of(path, described.description), massless or described.massless
            if described.instrument is None:
                return as_described(load_open(description, massless=chosen), path, described)
            from catenary.robots.dvrk_files import load_dvrk

            instrument = description_of(path, described.instrument)
            return as_described(load_dvrk(description, instrument=instrument, massless=chosen), path, described)
    if kind in (".urdf", ".xml", ".mjcf"):
        kind = f"<{xml_root_tag(read_bounded(path, MAX_XML_BYTES), str(path))}>"
        if kind not in _READERS:
            raise FileFormatError(f"{path}: root element {cut(kind)}: expected <robot> (URDF) or <mujoco> (MJCF)")
    if kind == ".xacro":
        from catenary.robots.urdf import XACRO_HINT

        raise FileFormatError(f"{path}: {XACRO_HINT}")
    if kind not in _READERS:
        endings = ".toml, .urdf, .xml, .mjcf, .json or .npz"
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected {endings}')
    module, function = _READERS[kind]
    return getattr(import_module(f"catenary.robots.{module}"), function)(path, massless=massless)


def load_text(text: str, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from the text of a URDF, such as the value of ROS's `robot_description`."""
    from catenary.robots.assembly import file_source
    from catenary.robots.urdf import parse_urdf

    where, content = "robot description", text.encode(errors="replace")
    if len(content) > MAX_XML_BYTES:
        raise FileFormatError(f"{where}: {len(content)} bytes, expected at most {MAX_XML_BYTES}")
    root = xml_root_tag(content, where)
    if root == "mujoco":
        raise FileFormatError(f"{where}: is MJCF, which may include files: expected the path of a file that holds it")
    source = file_source(Path("text"), content)
    return parse_urdf(content, where, massless=massless, sources=[source])


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have: too long, or with a zero byte
        return False
