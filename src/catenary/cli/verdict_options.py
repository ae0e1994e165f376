"""Options that mend a recording, and that accept what is found wrong with it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.options import Units

if TYPE_CHECKING:
    from catenary.recording.logs import Reading
    from catenary.recording.mend import Mend

Accept = Annotated[
    list[str] | None,
    Option("--accept", metavar="NAME", help="Go on though this was found wrong with the data; repeatable."),
]


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
        self, *, units: tuple[str, ...] | None = None, joint_names: tuple[str, ...] | None = None
    ) -> "Reading":
        """Return how to read recordings.

        Args:
            units: Of the robot's joints, where `--units` says none.
            joint_names: Of the robot's joints.
        """
        from catenary.recording.logs import Reading
        from catenary.recording.mend import si_units, units_of

        given = units if self.units is None else si_units(units_of(self.units)[1])
        return Reading(units=given, joint_names=joint_names, mend=self.mend())
