"""A robot in a pose: its links, frames and centres of mass, gravity, what holds it still, and where its ends can be."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.kinematics import forward_kinematics, link_poses, reachable_points
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.reports.arm_in_space import draw_links, end_frames, equal_axes
from catenary.reports.page import Picture, picture
from catenary.reports.torque_bars import RANGE, draw_torque_bars, joints_by_unit
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Part = Literal["frames", "masses", "gravity", "torques"]
PARTS: tuple[Part, ...] = ("frames", "masses", "gravity", "torques")
AXIS_COLORS = {"x": "#c0392b", "y": "#2a7f4f", "z": "#1d6fb8"}
MASS, GRAVITY = "#8a6d1f", "#7a3e9d"
REACHED = ("#6f8fb8", "#b08a5a", "#7fa37f")  # by end
WIDTH, ALONE, LEAST_HEIGHT = 10.0, 6.5, 5.2  # [inch]
ROW = 0.34  # [inch] of a joint's bar
TRIAD = 0.10  # of half the picture's width: the axes of a frame
ARROW = 0.45  # of it: gravity
SLIDE = 0.12  # of it, to either side: the axis of a joint
LARGEST_MASS = 16.0  # [points] across
OTHER_POSES = 12  # drawn at most
MANY_JOINTS = 8
CLOSE = 0.02  # of half the width: joints whose numbers stand at one place


def plot(
    model: RobotModel,
    q: ArrayLike | None = None,
    *,
    gravity: ArrayLike = LEVEL,
    hide: Sequence[Part] = (),
    workspace: bool = False,
    on: "Axes | Figure | None" = None,
) -> "Figure":
    """Draw a robot in its base frame, and the torques that hold it still.

    Lines are links, from joint to joint; squares the base, dots the ends. Joints are numbered as their bars are. A
    short line is the axis that a joint turns about, a dashed one the way that it slides. Spheres are centres of mass,
    their volume as the mass. Links without mass in the robot's description have none, and then there are no torques.

    Args:
        model: The robot.
        q: (n,) where its joints are [rad|m], the middle of each one's range, or 0 without one, when None; or (N, n)
            poses: the first is drawn whole, some of the others as lines, and torques with their range over all.
        gravity: (3,) in base axes, down [m/s2].
        hide: What not to draw, of "frames", "masses", "gravity" and "torques".
        workspace: Draw where the ends can be, too.
        on: Matplotlib's figure to draw on, an empty one; or axes of three dimensions, for the arm without torques. A
            new figure of no window when None.

    Returns:
        The figure; `savefig` writes it.

    Raises:
        InputError: q or gravity has another shape or is not finite; no such part; axes of two dimensions; a workspace
            without end.
    """
    rows, _ = as_batch("q", middle_pose(model) if q is None else q, model.n)
    down = as_array("gravity", gravity, (3,))
    unknown = [part for part in hide if part not in PARTS]
    if unknown:
        raise InputError(f"hide: {', '.join(unknown)}: expected some of {', '.join(PARTS)}")
    if len(rows) == 0:
        raise InputError("q: no pose, expected (n,) or (N, n) with N of 1 or more")
    axes, bars = _places(model, on, with_bars="torques" not in hide and not model.missing_inertia)
    _draw_robot(axes, model, rows, down, hide, workspace=workspace)
    if bars:
        draw_torque_bars(bars, model, rows[0], gravity_torque(model, rows, down))
        over = f"; lines: over all {len(rows)} poses" if len(rows) > 1 else ""
        bars[0].set_title(f"torques that hold it still{over}", fontsize=9, loc="left")
    figure: Figure = axes.get_figure(root=True)
    return figure


def robot_picture(model: RobotModel, q: ArrayLike, caption: str, *, gravity: ArrayLike = LEVEL) -> Picture:
    """Draw a robot for a page, in one pose or several; arguments as of `plot`."""
    figure = plot(model, q, gravity=gravity)
    return picture(figure, caption, f"The robot {model.name} drawn in space, with what holds it still.")


def middle_pose(model: RobotModel) -> Floats:
    """Return the middle of each joint's range, (n,) [rad|m]; 0 for a joint without one."""
    limited = np.isfinite(model.lower) & np.isfinite(model.upper)
    middle: Floats = np.zeros(model.n)
    middle[limited] = 0.5 * (model.lower[limited] + model.upper[limited])
    return middle


def _places(model: RobotModel, on: Any, *, with_bars: bool) -> tuple[Any, list[Any]]:
    """Return axes for the arm, and one for the bars of each unit."""
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    if isinstance(on, Axes):
        if on.name != "3d":
            raise InputError('on: axes of two dimensions; expected plt.subplot(projection="3d"), or a figure')
        return on, []
    groups = joints_by_unit(model) if with_bars else {}
    if on is None:
        height = max(LEAST_HEIGHT, ROW * model.n + 0.9 * len(groups)) if groups else ALONE
        on = Figure(figsize=(WIDTH if groups else ALONE, height), layout="constrained")
    if not groups:
        return on.add_subplot(projection="3d"), []
    grid = on.add_gridspec(
        len(groups), 2, width_ratios=(1.3, 1.0), height_ratios=[len(js) + 0.6 for js in groups.values()]
    )
    return on.add_subplot(grid[:, 0], projection="3d"), [
        on.add_subplot(grid[k, 1]) for k in range(len(groups))
    ]


def _draw_robot(
    axes: Any, model: RobotModel, rows: Floats, gravity: Floats, hide: Sequence[Part], *, workspace: bool
) -> None:
    q = rows[0]
    rotations, origins = link_poses(model, q)
    points = [draw_links(axes, model, q)]
    for k in np.unique(np.linspace(0, len(rows) - 1, OTHER_POSES + 1).astype(int))[1:]:
        points.append(draw_links(axes, model, rows[k], width=1.2, alpha=0.3))
    if workspace:
        points += _draw_workspace(axes, model)
    middle, half = equal_axes(axes, np.vstack(points))
    size = TRIAD * half
    _draw_joints(axes, model, q, rotations, origins, half)
    if "frames" not in hide:
        for name, color in AXIS_COLORS.items():
            axes.plot([], [], color=color, linewidth=1.6, label=name)
        _draw_triad(axes, np.eye(3), np.zeros(3), 1.6 * size)
        for rotation, origin in zip(rotations, origins, strict=True):
            _draw_triad(axes, rotation, 1e3 * origin, size)
        for name in end_frames(model):
            rotation, position = forward_kinematics(model, q, name)
            _draw_triad(axes, rotation, 1e3 * position, size)
    if "masses" not in hide:
        _draw_masses(axes, model, rotations, origins)
    if "gravity" not in hide:
        _draw_gravity(axes, gravity, middle, half)
    axes.set_title(model.name, fontsize=10)
    _draw_legend(axes)


def _draw_legend(axes: Any) -> None:
    """Name what is drawn below it: axes of frames first, then the rest, in columns of a frame's axis and another."""
    handles, labels = axes.get_legend_handles_labels()
    named = list(zip(handles, labels, strict=True))
    triad = [one for one in named if one[1] in AXIS_COLORS]
    rest = [one for one in named if one[1] not in AXIS_COLORS]
    columns = max(2, len(triad))
    shown = []
    for k in range(columns):
        shown += [*triad[k : k + 1], *rest[k::columns]]
    if not shown:
        return
    legend = axes.legend(
        *zip(*shown, strict=True), loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=columns, frameon=False,
        fontsize=8,
    )  # fmt: skip
    for handle in legend.legend_handles:
        if hasattr(handle, "set_sizes"):
            handle.set_sizes([60.0])
        elif handle.get_marker() == ".":
            handle.set(markersize=5.0, alpha=1.0)


def _draw_triad(axes: Any, rotation: Floats, origin: Floats, size: float) -> None:
    for axis, color in zip(rotation.T, AXIS_COLORS.values(), strict=True):
        axes.plot(*np.array([origin, origin + size * axis]).T, color=color, linewidth=1.6, alpha=0.9)


def _draw_joints(
    axes: Any, model: RobotModel, q: Floats, rotations: Floats, origins: Floats, half: float
) -> None:
    """Draw the joints' axes, and their numbers: several of one place together."""
    tree = model.tree
    numbers: list[tuple[Floats, list[str]]] = []
    for coordinate in range(model.n):
        links = np.flatnonzero(model.coupling[:, coordinate])
        if not len(links):
            continue
        link = int(links[0])  # the first that it moves
        origin, along = 1e3 * origins[link], rotations[link] @ tree.axis[link]
        start, end = -SLIDE * half, SLIDE * half
        style: dict[str, Any] = {"linewidth": 4.0, "alpha": 0.75}
        if tree.prismatic[link]:
            style = {"linewidth": 1.2, "linestyle": "--"}
            ends = (model.lower[coordinate], model.upper[coordinate])
            if np.isfinite(ends).all() and abs(model.coupling[link, coordinate]) == 1.0:
                turned = model.coupling[link, coordinate]
                start, end = (1e3 * turned * (stop - q[coordinate]) for stop in ends)
        axes.plot(*np.array([origin + start * along, origin + end * along]).T, color=RANGE, **style)
        for place, names in numbers:
            if np.linalg.norm(place - origin) < CLOSE * half:
                names.append(str(coordinate + 1))
                break
        else:
            numbers.append((origin, [str(coordinate + 1)]))
    for place, names in numbers:
        size = 8 if model.n <= MANY_JOINTS else 6
        axes.text(*(place + 0.06 * half), ", ".join(names), fontsize=size, color=RANGE)


def _draw_masses(axes: Any, model: RobotModel, rotations: Floats, origins: Floats) -> None:
    tree = model.tree
    heavy = tree.mass > 0.0
    if not heavy.any():
        axes.plot([], [], " ", label="no masses in its description")
        return
    at = 1e3 * (origins + np.einsum("kij,kj->ki", rotations, tree.com))[heavy]
    across = LARGEST_MASS * np.cbrt(tree.mass[heavy] / tree.mass.max())
    axes.scatter(
        *at.T, s=across**2, color=MASS, alpha=0.55, linewidths=0.0, depthshade=False,
        label=f"centres of mass, {tree.mass.max():.3g} kg and less",
    )  # fmt: skip
    if model.missing_inertia:
        axes.plot([], [], " ", label=f"without mass in its description: {len(model.missing_inertia)} links")


def _draw_gravity(axes: Any, gravity: Floats, middle: Floats, half: float) -> None:
    size = float(np.linalg.norm(gravity))
    label = f"gravity, {size:.4g} m/s2"
    if size == 0.0:
        axes.plot([], [], " ", label=label)
        return
    along = ARROW * half * gravity / size
    start = middle + half * np.array([-0.8, 0.8, 0.7]) - 0.5 * along
    axes.quiver(*start, *along, color=GRAVITY, linewidth=2.0, arrow_length_ratio=0.25, label=label)


def _draw_workspace(axes: Any, model: RobotModel) -> list[Floats]:
    """Draw where the ends can be; return the corners of a box around."""
    corners = []
    for k, name in enumerate(end_frames(model)):
        points = 1e3 * reachable_points(model, name, rng=np.random.default_rng(0))
        far = float(np.linalg.norm(points, axis=1).max())
        axes.plot(
            *points.T, ".", color=REACHED[k % len(REACHED)], markersize=1.2, alpha=0.4, zorder=0,
            label=f"where {name} can be, to {far:.0f} mm",
        )  # fmt: skip
        corners += [points.min(axis=0)[None], points.max(axis=0)[None]]
    return corners
