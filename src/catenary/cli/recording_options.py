"""Options of recordings: which columns are which quantity, and what to mend of them before they are used."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catenary.cli.options import argument, group, option, values_of

if TYPE_CHECKING:
    from catenary.recording.import_formats.mapping import RecordingMapping
    from catenary.recording.logs import Reading
    from catenary.recording.mend import Mend

RECORDINGS = argument(
    "DATA",
    "Recordings: .npz with q_des, q_act, ok in rad and m, .parquet logs, RAVEN-II's published .csv; others with --map.",
)
ACCEPT = option("NAME", "Continue despite this finding; repeatable.")
MAX_ERROR = option("E,E,...", "Leave out rows with larger errors, per joint in deg, mm.")
_READS = ("data", "train", "log", "file", "sources", "mcap")  # parameters that name a recording


def _of_recordings(metavar: str, help: str, default: Any = None) -> Any:
    return option(metavar, help, default, goes_with=_READS)


@group
class MappingOptions:
    """How a third-party recording is read: which of its columns are which quantity."""

    map: Sequence[str] = _of_recordings(
        "QUANTITY=COLUMNS",
        "Of a third-party recording: q_nominal, q_encoder, q_reported, qd, tau, ok, time or signal:NAME; may be "
        "repeated. Example: q_encoder=/optitrack/joints.position[0:6]@deg",
    )
    mapping: Path | None = _of_recordings("TOML", "The same from a file; catenary import proposes one.")

    def read(self, units: str | None = None, **settings: object) -> "RecordingMapping | None":
        """Return the mapping; None where none is given.

        Args:
            units: Of q_nominal and q_encoder, where the mapping has none.
            settings: Further keys of the mapping, such as robot; None for what is not given.
        """
        if not self.map and self.mapping is None:
            return None
        from catenary.recording.import_formats.mapping import mapping_of

        return mapping_of(self.map, file=self.mapping, units=units, settings=settings)


@group
class MendOptions:
    """How recordings are corrected before they are used."""

    units: str | None = _of_recordings(
        "U,U,...", "Unit of each joint's numbers: rad, m, or deg, mm, cm; q_encoder:deg,... of measurements alone."
    )
    swap: Sequence[str] = _of_recordings("J,J", "Exchange these measured columns; tau:J,J of torques.")
    sign: Sequence[str] = _of_recordings("J", "This measured column has the wrong sign; tau:J of torques.")
    scale: Sequence[str] = _of_recordings("J=F", "Multiply this measured column; tau:J=F of torques.")
    delay: float = _of_recordings("SECONDS", "Time by which measurements lag the commands.", 0.0)
    shift: int = _of_recordings("ROWS", "The same in rows, for recordings without time stamps.", 0)
    time_unit: str = _of_recordings("UNIT", "Unit of the stamps: s, ms, us, ns, min or ks.", "s")
    leave_out: Sequence[str] = _of_recordings("A:B", "Ignore measured rows A to B - 1; repeatable.")

    def mend(self) -> "Mend":
        """Return what to change of recordings."""
        from catenary.recording.mend import Mend

        typed = values_of(self, "swap", "sign", "scale", "delay", "shift", "time_unit", "leave_out")
        return Mend(units=(self.units,) if self.units else (), **typed)


@group
class RecordingOptions(MappingOptions, MendOptions):
    """How recordings are read, third-party ones too, and corrected before they are used."""

    def reading(self, robot: str | None = None) -> "Reading":
        """Return how to read recordings, of a robot of the catalogue or of a file where it is named.

        With a mapping, `--units` are those of its columns; else they come before the robot's.
        """
        from catenary.recording.logs import Reading
        from catenary.recording.mend import si_units, units_of

        names, own_units = None, None
        if robot is not None:
            from catenary.robots.catalog import load_robot

            arm = load_robot(robot)
            names, own_units = arm.joint_names, arm.joint_units
        as_trained = not getattr(self, "no_mend", False)
        array, given = (None, ()) if self.units is None else units_of(self.units)
        mapping = self.read(self.units if array is None else None, robot=robot)
        if mapping is not None:
            mend = self.mend() if array is not None else replace(self.mend(), units=())
            return Reading(joint_names=names, mapping=mapping, mend=mend, as_trained=as_trained)
        units = si_units(given) or own_units
        return Reading(units=units, joint_names=names, mend=self.mend(), as_trained=as_trained)

    def typed(self, robot: str | None) -> tuple[str, ...]:
        """Return the words that say how recordings are read, beside their mends."""
        from catenary.recording.mend import units_of

        mapped = [word for text in self.map for word in ("--map", text)]
        mapped += [] if self.mapping is None else ["--mapping", str(self.mapping)]
        if mapped and self.units and units_of(self.units)[0] is None:
            mapped += ["--units", self.units]
        return (*mapped, *(() if robot is None else ("--robot", robot)))


@group
class ModelRecordingOptions(RecordingOptions):
    """The same of recordings that are given to a model, which knows how its training data were mended."""

    no_mend: bool = option(
        None,
        "Do not correct recordings as the model's training data were corrected.",
        False,
        goes_with=(*_READS, "what"),
    )
