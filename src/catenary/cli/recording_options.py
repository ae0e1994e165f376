"""Options of recordings: which columns are which quantity, and how they are corrected before use."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import catenary
from catenary.cli.options import argument, group, option, values_of

if TYPE_CHECKING:
    from catenary.calibration.model import CalibrationModel
    from catenary.recording.import_formats.mapping import RecordingMapping
    from catenary.recording.logs import Reading

RECORDINGS = argument("DATA", "Recordings: .parquet logs, .npz with q_des, q_act (SI), RAVEN-II .csv; others by --map.")
ACCEPT = option("NAME", "Continue despite the finding of this name; repeatable.")
MAX_ERROR = option("E,E,...", "Leave out rows with larger errors, per joint in deg, mm.")
OWN_CLASS = option("MODULE:NAME", "Class or function of your own model; others it consists of after a comma.")
_READS = ("data", "train", "log", "file", "sources", "mcap")  # parameters that name a recording


def calibration_of(model: Path | None, own: str | None = None) -> "CalibrationModel | None":
    """Read a calibration model where one is named; `own` as OWN_CLASS."""
    from catenary.calibration.model_file import load_model

    return None if model is None else load_model(model, own)[0]


def _of_recordings(metavar: str, help: str, default: Any = None) -> Any:
    return option(metavar, help, default, goes_with=_READS)


@group
class MappingOptions:
    """Options of reading a third-party recording: its columns for each quantity."""

    map: Sequence[str] = _of_recordings("QUANTITY=COLUMNS", "E.g. q_encoder=/cam/joints.position[0:6]@deg; repeatable.")
    mapping: Path | None = _of_recordings("TOML", "Mapping file in place of --map; catenary import proposes one.")

    def read(self, units: str | None = None, **settings: object) -> "RecordingMapping | None":
        """Return the mapping, None without one; `units` where it has none, `settings` are further keys of it."""
        if not self.map and self.mapping is None:
            return None
        from catenary.recording.import_formats.mapping import mapping_of

        return mapping_of(self.map, file=self.mapping, units=units, settings=settings)


@group
class RecordingOptions(MappingOptions):
    """Options of reading recordings, third-party ones too, and of correcting them."""

    units: str | None = _of_recordings("U,U,...", "Joints' units: rad, m, deg, mm, cm; q_encoder:deg,... for it alone.")
    swap: Sequence[str] = _of_recordings("J,J", "Exchange these measured columns; tau:J,J of torques.")
    sign: Sequence[str] = _of_recordings("J", "This measured column has the wrong sign; tau:J of torques.")
    unwrap: Sequence[str] = _of_recordings("J=PERIOD", "Subtract whole periods [rad, m] from this measured column.")
    scale: Sequence[str] = _of_recordings("J=F", "Multiply this measured column; tau:J=F of torques.")
    offset: Sequence[str] = _of_recordings("J=X", "Add this to a measured column; q_nominal:J=X of positions [rad, m].")
    couple: Sequence[str] = _of_recordings("J/J=F", "Add F times the second's measured column to the first's.")
    clock: Sequence[str] = _of_recordings(
        "SECONDS,PPM", "Delay of measurements at the start, and its growth; J=SECONDS of one joint."
    )
    delay: float = _of_recordings("SECONDS", "Time by which measurements lag the commands.", 0.0)
    shift: int = _of_recordings("ROWS", "The same in rows, for recordings without time stamps.", 0)
    time_unit: str = _of_recordings("UNIT", "Unit of the stamps: s, ms, us, ns, min or ks.", "s")
    leave_out: Sequence[str] = _of_recordings("A:B", "Ignore measured rows A to B - 1; qd: velocities.")

    def reading(self, robot: str | None = None) -> "Reading":
        """Return the mapping and corrections of recordings, of a robot by catalogue name or file where one is named.

        With a mapping, `--units` are those of its columns; else they come before the robot's.
        """
        from catenary.recording.logs import Reading
        from catenary.verdict.corrections import Mend, si_units, units_of

        names, own_units = None, None
        if robot is not None:
            arm = catenary.load_robot(robot)
            names, own_units = arm.joint_names, arm.joint_units
        as_trained = not getattr(self, "as_is", False)
        array, stated = (None, ()) if self.units is None else units_of(self.units)
        mapping = self.read(self.units if array is None else None, robot=robot)
        typed = values_of(self, *(step.name for step in fields(Mend) if step.name != "units"))
        is_mended = self.units is not None and (mapping is None or array is not None)
        mend = Mend(units=(self.units or "",) if is_mended else (), **typed)
        units = None if mapping is not None else si_units(stated) or own_units
        return Reading(units=units, joint_names=names, mapping=mapping, mend=mend, as_trained=as_trained)

    def typed(self, robot: str | None) -> tuple[str, ...]:
        """Return the options that say how recordings are read, without corrections."""
        from catenary.verdict.corrections import units_of

        mapped = [word for text in self.map for word in ("--map", text)]
        mapped += [] if self.mapping is None else ["--mapping", str(self.mapping)]
        if mapped and self.units and units_of(self.units)[0] is None:
            mapped += ["--units", self.units]
        return (*mapped, *(() if robot is None else ("--robot", robot)))


@group
class ModelRecordingOptions(RecordingOptions):
    """The same for recordings given to a model, which knows how its training data were corrected."""

    as_is: bool = option(None, "Do not correct recordings like the training data.", False, goes_with=(*_READS, "what"))
