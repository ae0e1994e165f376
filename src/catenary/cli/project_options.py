"""What the commands on a project share: their options, and the project that they open."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catenary.cli.beside_robot import connection_of
from catenary.cli.terminal import roll_and_pitch, words
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project

Folder = Annotated[
    Path, typer.Argument(metavar="PROJECT", help="Folder of the project; made if it is not there.")
]
Seed = Annotated[
    int | None,
    typer.Option("--seed", help="Draws another simulated robot of the kind. [default: the nominal one]"),
]
Tilt = Annotated[
    str | None,
    typer.Option("--base-tilt-deg", metavar="R,P", help="Roll about x, then pitch about y, of the base."),
]
Payload = Annotated[float | None, typer.Option("--payload", metavar="KG", help="Mass at the tool's wrist.")]
Side = Annotated[str | None, typer.Option("--side", help="left (gold) or right (green). [default: left]")]
Direction = Annotated[
    str | None, typer.Option("--direction", help="Of the zig-zag: J1, J2, J3, J1-J2, J2-J3, J1-J3, J1-J2-J3.")
]
Sparsity = Annotated[
    str | None, typer.Option("--sparsity", metavar="S,S,...", help="Of the zig-zags. [default: 1/2,1/3,1/4]")
]
StateRate = Annotated[
    float | None, typer.Option("--state-rate", metavar="HZ", help="Of raven_state, 30 or 100. [default: 30]")
]
Hours = Annotated[float | None, typer.Option("--hours", help="Length of the random motion.")]


def open_project(
    folder: Path,
    seed: int | None = None,
    tilt: str | None = None,
    payload: float | None = None,
    side: str | None = None,
    direction: str | None = None,
    sparsity: str | None = None,
    hours: float | None = None,
    state_rate: float | None = None,
    ros: int | None = None,
) -> "Project":
    """Open a project with the settings it has, changed by what was typed."""
    from catenary.workflows.project.folder import Project, ProjectSettings, project_settings

    settings = project_settings(folder) or ProjectSettings()
    if tilt is not None:
        settings = replace(settings, base_tilt_deg=roll_and_pitch("--base-tilt-deg", tilt))
    if sparsity is not None:
        settings = replace(settings, sparsities=tuple(_fraction(word) for word in words(sparsity)))
    changes: dict[str, Any] = {"seed": seed, "payload_kg": payload, "side": side, "direction": direction}
    changes["state_rate_hz"], changes["connection"] = state_rate, connection_of(ros)
    changes["test_minutes"] = None if hours is None else 60.0 * hours
    return Project(
        folder, replace(settings, **{key: value for key, value in changes.items() if value is not None})
    )


def require_project(folder: Path) -> None:
    """Refuse a folder in which nothing was begun, so that a mistyped name makes no new project."""
    from catenary.workflows.project.folder import SETTINGS

    if not (folder / SETTINGS).is_file():
        raise InputError(f"{folder}: is no project; begin one with catenary home, excite or calibrate")


def _fraction(text: str) -> float:
    upper, _, lower = text.partition("/")
    try:
        value = float(upper) / float(lower) if lower else float(upper)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"--sparsity: expected numbers such as 1/2 or 0.5, got {text!r}") from None
    return value
