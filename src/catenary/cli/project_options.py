"""What the commands on a project share: their options, the project that they open, and what they say of a step."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from catenary.cli.options import robots_beginning
from catenary.cli.terminal import base_tilt, print_json, progress_bar, words
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project

Folder = Annotated[Path, Argument(metavar="PROJECT", help="Folder of the project; made if it is not there.")]
BegunFolder = Annotated[Path, Argument(metavar="PROJECT", help="Folder of a project that was begun.")]
Seed = Annotated[
    int | None,
    Option("--seed", help="Simulate another robot, drawn with this seed. [default: the nominal one]"),
]
ArmNamespace = Annotated[
    str | None,
    Option("--namespace", metavar="/NAME", help="Of a dVRK PSM: in front of its topics. [default: /PSM1]"),
]
ArmKind = Annotated[
    str | None,
    Option(
        "--robot",
        metavar="ROBOT",
        help="Which robot a new project is of: raven2 or dvrk_psm. [default: raven2]",
        autocompletion=robots_beginning,
    ),
]
Hours = Annotated[float | None, Option("--hours", help="Length of the random motion.")]


@dataclass(frozen=True)
class ArmOptions:
    """Options that say which RAVEN-II a project is about."""

    seed: Seed = None
    base_tilt_deg: Annotated[
        str | None, Option(metavar="R,P", help="Roll about x, then pitch about y, of the base.")
    ] = None
    payload: Annotated[float | None, Option(metavar="KG", help="Mass at the tool's wrist.")] = None
    side: Annotated[str | None, Option(help="left (gold) or right (green). [default: left]")] = None


@dataclass(frozen=True)
class ExcitationOptions(ArmOptions):
    """Options of an arm, and of the zig-zag that it is calibrated with."""

    direction: Annotated[
        str | None, Option(help="Joints that the zig-zag sweeps: J1, J2, J3, J1-J2, J2-J3, J1-J3, J1-J2-J3.")
    ] = None
    form: Annotated[
        str | None, Option(help="Which published J1-J2-J3: generator, files or paper. [default: generator]")
    ] = None
    sparsity: Annotated[
        str | None, Option(metavar="S,S,...", help="Sparsities of the zig-zags. [default: 1/2,1/3,1/4]")
    ] = None
    train_minutes: Annotated[
        float | None,
        Option(metavar="MIN", help="Length of a dVRK PSM's motion to train on. [default: 20]"),
    ] = None
    state_rate: Annotated[
        float | None, Option(metavar="HZ", help="Rate of raven_state, 30 or 100. [default: 30]")
    ] = None


def open_project(
    folder: Path,
    arm: ArmOptions | None = None,
    *,
    hours: float | None = None,
    ros: int | None = None,
    columns: str | None = None,
    robot: str | None = None,
    namespace: str | None = None,
) -> "Project":
    """Open a project with the settings it has, changed by what was typed."""
    from catenary.workflows.project.folder import Project, ProjectSettings, project_settings

    if ros not in (None, 1, 2):
        raise InputError(f"--ros {ros}: expected 1 or 2")
    changes: dict[str, Any] = {} if ros is None else {"connection": f"ros{ros}"}
    if robot is not None:
        changes["robot"] = robot
    if namespace is not None:
        changes["namespace"] = namespace
    if columns is not None:
        changes["columns"] = tuple(words(columns))
    if hours is not None:
        changes["test_minutes"] = 60.0 * hours
    if arm is not None:
        typed = {"seed": arm.seed, "payload_kg": arm.payload, "side": arm.side}
        if isinstance(arm, ExcitationOptions):
            typed |= {"direction": arm.direction, "form": arm.form, "state_rate_hz": arm.state_rate}
            typed["train_minutes"] = arm.train_minutes
            if arm.sparsity is not None:
                changes["sparsities"] = tuple(_fraction(word) for word in words(arm.sparsity))
        changes |= {key: value for key, value in typed.items() if value is not None}
        if arm.base_tilt_deg is not None:
            changes["base_tilt_deg"] = base_tilt(arm.base_tilt_deg)
    return Project(folder, replace(project_settings(folder) or ProjectSettings(), **changes))


def require_project(folder: Path) -> None:
    """Refuse a folder in which nothing was begun, so that a mistyped name makes no new project."""
    from catenary.workflows.project.folder import is_project

    if not is_project(folder):
        raise InputError(f"{folder}: is no project; begin one with catenary home, excite or calibrate")


def say_step(project: "Project", what: str, was_run: bool, as_json: bool, content: Any) -> None:
    """Say what a step did, or that it had been done."""
    if as_json:
        print_json({"project": str(project.folder), "run": was_run, **content})
    else:
        print(f"{project.folder}: {what}" + ("" if was_run else " before; nothing to do"))


@contextmanager
def step_progress(label: str, project: "Project | None" = None) -> Iterator[Callable[[float], None]]:
    """Show a bar while a step runs."""
    if project is not None and project.settings.connection != "simulation":
        yield lambda _: None  # a bar would hide what the person beside the robot is asked
        return
    with progress_bar(label) as progress:
        yield progress


def _fraction(text: str) -> float:
    upper, _, lower = text.partition("/")
    try:
        value = float(upper) / float(lower) if lower else float(upper)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"--sparsity: expected numbers such as 1/2 or 0.5, got {text!r}") from None
    return value
