"""Options that commands of several families have; what a family shares stands in its own file."""

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
AsJsonNotTables = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="HTML", help="Also write a self-contained page.")
]
JsonLines = Annotated[bool, typer.Option("--json", help="Print a JSON line a second, and one at the end.")]
Carrier = Annotated[str, typer.Option("--ros", metavar="1|2|none", help="What carries the messages.")]
Duration = Annotated[
    float | None, typer.Option("--duration", metavar="S", min=0.0, help="Then end. [default: Ctrl-C]")
]
Record = Annotated[
    Path | None, typer.Option("--record", metavar="FOLDER", help="Record a RAVEN-II's topics beside.")
]
Baud = Annotated[int, typer.Option("--baud", min=300, help="Speed of the serial line.")]
MountingFile = Annotated[
    Path | None, typer.Option("--mounting", metavar="FILE", help="Mounting file of the sensor.")
]
Hanging = Annotated[bool, typer.Option("--hanging", help="The base may hang upside down.")]
