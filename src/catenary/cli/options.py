"""Options that commands of several families have, and groups of them that a command takes as one argument."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

from typer import Option

AsJson = Annotated[bool, Option("--json", help="Print JSON.")]
AsJsonNotTables = Annotated[bool, Option("--json", help="Print JSON instead of tables.")]
Units = Annotated[
    str | None,
    Option(
        "--units",
        metavar="U,U,...",
        help="Unit of each joint's numbers: rad, m, or deg, mm, cm; q_encoder:deg,... of measurements alone.",
    ),
]
Report = Annotated[Path | None, Option("--report", metavar="HTML", help="Also write a self-contained page.")]
JsonLines = Annotated[bool, Option("--json", help="Print a JSON line a second, and one at the end.")]
Carrier = Annotated[str, Option("--ros", metavar="1|2|none", help="ROS that carries the messages.")]
Duration = Annotated[
    float | None, Option("--duration", metavar="S", min=0.0, help="How long to run. [default: until Ctrl-C]")
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


def with_groups_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the options of its groups in place of the groups.

    A group is a parameter whose type is a dataclass of options with defaults. Help lists its options behind the
    command's own, and --json last.
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

    def run(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        command(**given)

    run.__doc__ = command.__doc__
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run
