"""catenary plot."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from catenary.cli.gravity_source import GivenGravity
from catenary.cli.joint_options import Q, QDeg, beyond_limits, given_joints
from catenary.cli.options import AsJson
from catenary.cli.out_files import NAMED_AS_TYPED, PICTURE, out_path, refuse_outputs
from catenary.cli.robots import DescriptionOptions, Robot
from catenary.cli.terminal import print_json, print_notes, words
from catenary.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150
WITHOUT_WINDOWS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")  # of matplotlib's ways to draw


def plot(
    robot: Robot,
    given: GivenGravity,
    description: DescriptionOptions,
    q: Q = None,
    q_deg: QDeg = None,
    workspace: Annotated[bool, Option("--workspace", help="Draw where the ends can be, too.")] = False,
    hide: Annotated[
        str | None,
        Option(metavar="PART,...", help="What not to draw, of frames, masses, gravity and torques."),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            parser=out_path,
            help=f"Picture to write, .png, .svg or .pdf. {NAMED_AS_TYPED} [default: a window]",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a robot, gravity, and the torques that hold it.

    With its links, frames and centres of mass; without --q in the middle of its joints' ranges.

    Example: catenary plot panda --q-deg 0,-30,0,-120,0,90,45 --base-tilt-deg 0,20 --out panda.png
    """
    from catenary.files import write_atomically
    from catenary.reports.robot_plot import middle_pose
    from catenary.reports.robot_plot import plot as draw

    refuse_outputs({"--out": (out, PICTURE)})
    if out is None and as_json:
        raise InputError("plot: --json goes with --out")
    gravity = given.told("plot")
    model = description.load(robot)
    values = given_joints(model, q, q_deg)
    pose = middle_pose(model) if values is None else values
    notes = beyond_limits(model, pose) if values is not None else []
    hidden: Any = words(hide or "")
    if model.missing_inertia and "torques" not in hidden:
        links = ", ".join(model.missing_inertia)
        notes.append(f"no torques: the description gives no mass of {links}")
    print_notes([*notes, *given.doubts(gravity)])
    on = _window(model.name) if out is None else None
    figure = draw(model, pose, gravity=gravity, hide=hidden, workspace=workspace, on=on)
    if out is None:
        _show()
        return
    kind = out.suffix.lower().removeprefix(".") if out.suffix.lower() in PICTURE.endings else "png"
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=DOTS_PER_INCH)
    write_atomically(out, buffer.getvalue())
    if as_json:
        print_json(
            {"robot": model.name, "q": pose, "unit": model.joint_units, "gravity": gravity, "out": str(out)}
        )
        return
    print(f"picture: {out}")


def _window(name: str) -> "Figure":
    """Return a figure in a window that is not shown yet."""
    import matplotlib.pyplot as plt

    if plt.get_backend().lower() in WITHOUT_WINDOWS:
        raise InputError("plot: no window can be opened here; give --out FILE, as robot.png")
    return plt.figure(name, figsize=(11.0, 6.0), layout="constrained")


def _show() -> None:
    import matplotlib.pyplot as plt

    plt.show()
