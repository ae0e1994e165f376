"""Options that commands of several families have, and groups of them that a command takes as one argument."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from catenary.cli.terminal import without_notes
from catenary.crtk.dds.arguments import said_ros_arguments, say_ros_arguments
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.recording.import_formats.mapping import RecordingMapping
    from catenary.recording.logs import Reading
    from catenary.recording.mend import Mend

AsJson = Annotated[bool, Option("--json", help="Print JSON.")]
NoNotes = Annotated[bool, Option("--no-notes", help="Print no notes: results and errors only.")]
AsJsonNotTables = Annotated[bool, Option("--json", help="Print JSON instead of tables.")]
Units = Annotated[
    str | None,
    Option(
        "--units",
        metavar="U,U,...",
        help="Unit of each joint's numbers: rad, m, or deg, mm, cm; q_encoder:deg,... of measurements alone.",
    ),
]
NoMend = Annotated[
    bool,
    Option("--no-mend", help="Do not mend recordings as the model's training data were mended."),
]
JsonLines = Annotated[bool, Option("--json", help="Print a JSON line a second, and one at the end.")]
Carrier = Annotated[str, Option("--ros", metavar="1|2|none", help="ROS that carries the messages.")]
RosDistro = Annotated[
    str | None,
    Option(
        "--ros-distro",
        metavar="NAME",
        help="On ROS 2: distribution of the others, such as humble. [default: ROS_DISTRO, or jazzy]",
    ),
]
# parameters of commands that may speak ROS: those that ask for it, and those of projects, which say it themselves
ROS_PARAMETERS = {"ros", "simulated"}
Duration = Annotated[
    float | None, Option("--duration", metavar="S", min=0.0, help="How long to run. [default: until Ctrl-C]")
]
NodeName = Annotated[
    str | None,
    Option("--name", metavar="NAME", help="On ROS: this program's. [default: catenary_COMMAND_PID]"),
]
Record = Annotated[Path | None, Option("--record", metavar="FOLDER", help="Also record a RAVEN-II's topics.")]
Baud = Annotated[int, Option("--baud", min=300, help="Speed of the serial line.")]
MountingFile = Annotated[Path | None, Option("--mounting", metavar="FILE", help="Sensor's mounting file.")]
SimulatedSeed = Annotated[
    int | None,
    Option(
        "--seed", metavar="N", min=0,
        help="Simulate another robot of the kind, drawn with this seed. [default: the nominal one]",
    ),
]  # fmt: skip
Hanging = Annotated[bool, Option("--hanging", help="The base may hang upside down.")]


Accept = Annotated[
    list[str] | None,
    Option("--accept", metavar="NAME", help="Go on though this was found wrong with the data; repeatable."),
]


@dataclass(frozen=True)
class MappingOptions:
    """How a recording of another make is read: which of its columns are which quantity."""

    map: Annotated[
        list[str] | None,
        Option(
            "--map",
            metavar="QUANTITY=COLUMNS",
            help="Of a recording of another make: q_nominal, q_encoder, qd, tau, ok, time or signal:NAME; may be "
            "repeated. Example: q_encoder=/optitrack/joints.position[0:6]@deg",
        ),
    ] = None
    mapping: Annotated[
        Path | None,
        Option("--mapping", metavar="TOML", help="The same from a file; catenary import proposes one."),
    ] = None

    def read(self, units: str | None = None, **settings: object) -> "RecordingMapping | None":
        """Return the mapping; None where none is given.

        Args:
            units: Of q_nominal and q_encoder, where the mapping has none.
            settings: Further keys of the mapping, such as robot; None for what is not given.
        """
        if not self.map and self.mapping is None:
            return None
        from catenary.recording.import_formats.mapping import mapping_of

        return mapping_of(self.map or (), file=self.mapping, units=units, settings=settings)


@dataclass(frozen=True)
class MendOptions:
    """How recordings are mended before they are used."""

    units: Units = None
    swap: Annotated[
        list[str] | None,
        Option(metavar="J,J", help="These measured columns stand in each other's place; tau:J,J of torques."),
    ] = None
    sign: Annotated[
        list[str] | None,
        Option(metavar="J", help="This measured column has the wrong sign; tau:J of torques."),
    ] = None
    scale: Annotated[
        list[str] | None, Option(metavar="J=F", help="Multiply this measured column; tau:J=F of torques.")
    ] = None
    shift: Annotated[
        int, Option(metavar="ROWS", help="Rows by which measurements lie behind the commands.")
    ] = 0
    time_unit: Annotated[
        str, Option(metavar="UNIT", help="Unit of the stamps: s, ms, us, ns, min or ks.")
    ] = "s"
    leave_out: Annotated[
        list[str] | None, Option(metavar="A:B", help="Do not trust measured rows A to before B; repeatable.")
    ] = None

    def mend(self) -> "Mend":
        """Return what to change of recordings."""
        from catenary.recording.mend import Mend

        return Mend(
            units=(self.units,) if self.units else (),
            swap=tuple(self.swap or ()),
            sign=tuple(self.sign or ()),
            scale=tuple(self.scale or ()),
            shift=self.shift,
            time_unit=self.time_unit,
            leave_out=tuple(self.leave_out or ()),
        )

    def reading(
        self,
        foreign: MappingOptions,
        *,
        units: tuple[str, ...] | None = None,
        joint_names: tuple[str, ...] | None = None,
        robot: str | None = None,
    ) -> "Reading":
        """Return how to read recordings.

        Args:
            foreign: Mapping of recordings of another make; `--units` then are those of its columns.
            units: Of the robot's joints, where `--units` says none.
            joint_names: Of the robot's joints.
            robot: Its name.
        """
        from catenary.recording.logs import Reading
        from catenary.recording.mend import si_units, units_of

        as_trained = not getattr(self, "no_mend", False)
        array, given = (None, ()) if self.units is None else units_of(self.units)
        mapping = foreign.read(self.units if array is None else None, robot=robot)
        if mapping is not None:
            mend = self.mend() if array is not None else replace(self.mend(), units=())
            return Reading(joint_names=joint_names, mapping=mapping, mend=mend, as_trained=as_trained)
        si = si_units(given) or units
        return Reading(units=si, joint_names=joint_names, mend=self.mend(), as_trained=as_trained)


@dataclass(frozen=True)
class ModelMendOptions(MendOptions):
    """The same of recordings that are given to a model, which knows how its training data were mended."""

    no_mend: NoMend = False


BaseTilt = Annotated[
    str | None,
    Option(
        "--base-tilt-deg", metavar="R,P",
        help="Turn the base by R about x, then by P about its own y (of raven2 the axis of joint 1, reversed).",
    ),
]  # fmt: skip
# how options were written before, per command, and now
_FORMER = {
    ("gravity", "--tilt-deg"): "--base-tilt-deg",
    ("sense", "--tilt-deg"): "--base-tilt-deg",
    ("gravity", "--tilt"): "--base-tilt-deg",
    ("sense", "--tilt"): "--base-tilt-deg",
}
_LISTS = {
    "--base-tilt-deg": "R,P",
    "--rock-deg": "FROM,TO",
    "--gravity": "X,Y,Z",
    "--imu-reading": "AX,AY,AZ",
}


def refuse_former_spelling(command: str, arguments: Sequence[str]) -> None:
    """Refuse what was written otherwise once, saying how it is written now: names, and lists without commas."""
    for k, word in enumerate(arguments):
        name = word.partition("=")[0]
        now = _FORMER.get((command, name))
        if now is not None:
            raise InputError(f"{name}: is {now} {_LISTS[now]} now, as for every command: {now} 0,20")
        following = arguments[k + 1 : k + 3]
        if word in _LISTS and len(following) == 2 and all(map(_is_number, following)):
            raise InputError(
                f"{word}: expected {_LISTS[word]} with commas, got {' '.join(following)} with spaces"
            )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def robots_beginning(incomplete: str) -> list[str]:
    """Return names in the catalogue that begin with what was typed: a shell completes them, and files by itself."""
    from catenary.robots.catalog import robot_names

    return [name for name in robot_names() if name.startswith(incomplete)]


def with_groups_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the options of its groups in place of the groups.

    A group is a parameter whose type is a dataclass of options with defaults. Help lists its options behind the
    command's own, then --json and, for every command, --no-notes.
    """
    own = signature(command).parameters.values()
    groups: dict[str, Any] = {p.name: p.annotation for p in own if is_dataclass(p.annotation)}
    shared = [
        Parameter(field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type)
        for group in groups.values()
        for field in fields(group)
    ]
    parameters = [p.replace(kind=p.KEYWORD_ONLY) for p in own if p.name not in groups]
    parameters = sorted([*parameters, *shared], key=lambda p: 2 if p.name == "as_json" else p in shared)
    on_ros = any(p.name in ROS_PARAMETERS for p in parameters)
    if on_ros:
        parameters.append(Parameter("ros_distro", Parameter.KEYWORD_ONLY, default=None, annotation=RosDistro))
    parameters.append(Parameter("no_notes", Parameter.KEYWORD_ONLY, default=False, annotation=NoNotes))

    def run(*, no_notes: bool = False, ros_distro: str | None = None, **given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        if ros_distro is not None:
            say_ros_arguments(replace(said_ros_arguments(), distro=ros_distro))
        with without_notes(no_notes):
            command(**given)

    run.__doc__ = command.__doc__
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run
