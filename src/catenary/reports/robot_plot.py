"""Plot of a robot in a pose: links, frames, centres of mass, gravity, holding torques."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.kinematics import forward_kinematics, link_poses
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.reports.page import BLUE, ORANGE, Picture, picture
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.units import TORQUE_UNIT, in_words

Part = Literal["frames", "masses", "gravity", "torques"]
PARTS: tuple[Part, ...] = ("frames", "masses", "gravity", "torques")
_AXIS_COLORS = {"x": "#e57368", "y": "#2a7f4f", "z": "#123f78"}
_MASS_COLOR, _GRAVITY_COLOR = "#8a6d1f", "#7a3e9d"
_MIN_EXTENT_MM = 1.0  # of a plot
_SAME_POINT_M = 1e-6  # distance of distinct points
_RANGE_COLOR, _LIMIT_COLOR = "#1c2430", "#c0392b"
_ROUNDING_TORQUE = 1e-9  # [Nm|N]
_SHOWN_LIMIT_BARS = 3.0  # largest limit that is drawn, in lengths of the largest bar; others are text only
_WIDE_TEXT_SHARE, _SHORT_TEXT_SHARE = 0.31, 0.16  # of the width, for the text beside a bar
_MAX_NAME_LENGTH = 24  # characters beside a bar
_WIDTH_INCH, _ALONE_INCH, _MIN_HEIGHT_INCH = 10.0, 6.5, 5.2
_ROW_INCH = 0.34  # of a joint's bar
_TRIAD_SHARE = 0.10  # length of a frame's axes, relative to half the plot's width
_ARROW_SHARE = 0.45  # length of gravity's arrow, likewise
_AXIS_SHARE = 0.12  # half the length of a joint's axis, likewise
_MAX_MASS_POINTS = 16.0  # [points] across
_MAX_OTHER_POSES = 12  # drawn at most
_MANY_JOINTS = 8
_SAME_PLACE_SHARE = 0.02  # largest distance of joints with a common label, likewise


class ShownFigure(Figure):
    """Matplotlib's, which a notebook shows in its first cell too: it draws itself, without pyplot."""

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, format="png", dpi=100)
        return content.getvalue()


def plot(
    model: RobotModel,
    q: ArrayLike | None = None,
    *,
    gravity: ArrayLike = LEVEL,
    hide: Sequence[Part] = (),
    on: Axes | Figure | None = None,
) -> Figure:
    """Draw a robot in its base frame, with its holding torques; `savefig` of the returned figure writes it.

    Lines are links, from joint to joint; a square is the base, dots are the ends; numbers are joints, as in the bars. A
    short line is the axis of a revolute joint, a dashed one the range of a prismatic joint; spheres are centres of
    mass, with volumes proportional to the masses.

    Args:
        model: Robot; torques are omitted if links have no mass in its description.
        q: (n,) [rad|m], the middle of its ranges when None; or (N, n) poses, all but the first as lines only.
        gravity: (3,) in base axes [m/s2].
        hide: Parts to omit, of "frames", "masses", "gravity" and "torques".
        on: Empty Matplotlib figure, or 3D axes for the arm without torques.

    Examples:
        >>> figure = catenary.plot(catenary.load_robot("two_link"), [0.3, 0.5])
        >>> len(figure.axes)
        2
    """
    rows, _ = as_batch("q", middle_pose(model) if q is None else q, model.n)
    down = as_array("gravity", gravity, (3,))
    unknown = [part for part in hide if part not in PARTS]
    if unknown:
        raise InputError(f"hide: {', '.join(unknown)}: expected some of {', '.join(PARTS)}")
    if len(rows) == 0:
        raise InputError("q: no pose, expected (n,) or (N, n) with N of 1 or more")
    axes, bars = _places(model, on, with_bars="torques" not in hide and not model.missing_inertia)
    _draw_robot(axes, model, rows, down, hide)
    if bars:
        draw_torque_bars(bars, model, rows[0], gravity_torque(model, rows, down))
        over = f"; lines: over all {len(rows)} poses" if len(rows) > 1 else ""
        bars[0].set_title(f"holding torques{over}", fontsize=9, loc="left")
    return axes.get_figure(root=True)


def robot_picture(model: RobotModel, q: ArrayLike, caption: str, *, gravity: ArrayLike = LEVEL) -> Picture:
    """Draw a robot for a page.

    Args:
        q: (n,) pose or (N, n) poses [rad|m].
        gravity: (3,) in base axes [m/s2].
    """
    figure = plot(model, q, gravity=gravity)
    return picture(figure, caption, f"The robot {model.name} in three dimensions, with its holding torques.")


def middle_pose(model: RobotModel) -> Floats:
    """Return the middle of each joint's range, (n,) [rad|m]; 0 for a joint without one."""
    limited = np.isfinite(model.lower) & np.isfinite(model.upper)
    middle: Floats = np.zeros(model.n)
    middle[limited] = 0.5 * (model.lower[limited] + model.upper[limited])
    return middle


def _places(model: RobotModel, on: Any, *, with_bars: bool) -> tuple[Any, list[Any]]:
    if isinstance(on, Axes):
        if on.name != "3d":
            raise InputError('on: axes of two dimensions; expected plt.subplot(projection="3d"), or a figure')
        return on, []
    groups = joints_by_unit(model) if with_bars else {}
    if on is None:
        height = max(_MIN_HEIGHT_INCH, _ROW_INCH * model.n + 0.9 * len(groups)) if groups else _ALONE_INCH
        on = ShownFigure(figsize=(_WIDTH_INCH if groups else _ALONE_INCH, height), layout="constrained")
    if not groups:
        return on.add_subplot(projection="3d"), []
    grid = on.add_gridspec(
        len(groups), 2, width_ratios=(1.3, 1.0), height_ratios=[len(js) + 0.6 for js in groups.values()]
    )
    return on.add_subplot(grid[:, 0], projection="3d"), [on.add_subplot(grid[k, 1]) for k in range(len(groups))]


def _draw_robot(axes: Any, model: RobotModel, rows: Floats, gravity: Floats, hide: Sequence[Part]) -> None:
    q = rows[0]
    rotations, origins = link_poses(model, q)
    points = [draw_links(axes, model, q)]
    for k in np.unique(np.linspace(0, len(rows) - 1, _MAX_OTHER_POSES + 1).astype(int))[1:]:
        points.append(draw_links(axes, model, rows[k], width=1.2, alpha=0.3))
    middle, half = equal_axes(axes, np.vstack(points))
    size = _TRIAD_SHARE * half
    _draw_joints(axes, model, q, rotations, origins, half)
    if "frames" not in hide:
        for name, color in _AXIS_COLORS.items():
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
    if axes.get_legend_handles_labels()[0]:
        legend = axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=2, frameon=False, fontsize=8)
        for handle in legend.legend_handles:
            if hasattr(handle, "set_sizes"):
                handle.set_sizes([60.0])


def _draw_triad(axes: Any, rotation: Floats, origin: Floats, size: float) -> None:
    for axis, color in zip(rotation.T, _AXIS_COLORS.values(), strict=True):
        axes.plot(*np.array([origin, origin + size * axis]).T, color=color, linewidth=1.6, alpha=0.9)


def _draw_joints(axes: Any, model: RobotModel, q: Floats, rotations: Floats, origins: Floats, half: float) -> None:
    """Draw the joints' axes and numbers; coincident joints share a label."""
    tree = model.tree
    numbers: list[tuple[Floats, list[str]]] = []
    for coordinate in range(model.n):
        links = np.flatnonzero(model.coupling[:, coordinate])
        if not len(links):
            continue
        link = int(links[0])  # the first one that moves
        origin, along = 1e3 * origins[link], rotations[link] @ tree.axis[link]
        start, end = -_AXIS_SHARE * half, _AXIS_SHARE * half
        style: dict[str, Any] = {"linewidth": 4.0, "alpha": 0.75}
        if tree.prismatic[link]:
            style = {"linewidth": 1.2, "linestyle": "--"}
            ends = (model.lower[coordinate], model.upper[coordinate])
            if np.isfinite(ends).all() and abs(model.coupling[link, coordinate]) == 1.0:
                turned = model.coupling[link, coordinate]
                start, end = (1e3 * turned * (stop - q[coordinate]) for stop in ends)
        axes.plot(*np.array([origin + start * along, origin + end * along]).T, color=_RANGE_COLOR, **style)
        for place, names in numbers:
            if np.linalg.norm(place - origin) < _SAME_PLACE_SHARE * half:
                names.append(str(coordinate + 1))
                break
        else:
            numbers.append((origin, [str(coordinate + 1)]))
    for place, names in numbers:
        size = 8 if model.n <= _MANY_JOINTS else 6
        axes.text(*(place + 0.06 * half), ", ".join(names), fontsize=size, color=_RANGE_COLOR)


def _draw_masses(axes: Any, model: RobotModel, rotations: Floats, origins: Floats) -> None:
    tree = model.tree
    heavy = tree.mass > 0.0
    if not heavy.any():
        axes.plot([], [], " ", label="no masses in its description")
        return
    if model.missing_inertia:
        axes.plot([], [], " ", label=f"without mass in its description: {len(model.missing_inertia)} links")
    at = 1e3 * (origins + np.einsum("kij,kj->ki", rotations, tree.com))[heavy]
    across = _MAX_MASS_POINTS * np.cbrt(tree.mass[heavy] / tree.mass.max())
    axes.scatter(
        *at.T, s=across**2, color=_MASS_COLOR, alpha=0.55, linewidths=0.0, depthshade=False,
        label=f"centres of mass, {tree.mass.max():.3g} kg and less",
    )  # fmt: skip


def _draw_gravity(axes: Any, gravity: Floats, middle: Floats, half: float) -> None:
    size = float(np.linalg.norm(gravity))
    along = _ARROW_SHARE * half * gravity / max(size, 1e-12)
    start = middle + half * np.array([-0.8, 0.8, 0.7]) - 0.5 * along
    label = f"gravity, {size:.4g} m/s2"
    axes.quiver(*start, *along, color=_GRAVITY_COLOR, linewidth=2.0, arrow_length_ratio=0.25, label=label)


def end_frames(model: RobotModel) -> list[str]:
    """Return the frames at a robot's ends: its tip, and the farthest one on every other terminal link."""
    farthest: dict[int, tuple[float, str]] = {}
    for name, (link, pose) in model.frames.items():
        distance = float(np.linalg.norm(pose.position))
        if link >= 0 and link not in model.tree.parent and distance > farthest.get(link, (_SAME_POINT_M, ""))[0]:
            farthest[link] = (distance, name)
    farthest.pop(model.frame().link, None)
    return [model.tip, *(name for _, name in farthest.values())]


def link_segments(model: RobotModel, q: Floats) -> Floats:
    """Return an arm's line segments (S, 2, 3) [m] at q (n,) [rad|m]: to its links' frames, then to `end_frames`."""
    origins = link_poses(model, q)[1]
    starts = [np.zeros(3) if parent < 0 else origins[parent] for parent in model.tree.parent]
    lines = list(zip(starts, origins, strict=True))
    for name in end_frames(model):
        link = model.frame(name).link
        lines.append((np.zeros(3) if link < 0 else origins[link], forward_kinematics(model, q, name)[1]))
    return np.array(lines)


def draw_links(axes: Any, model: RobotModel, q: Floats, *, width: float = 2.5, alpha: float = 1.0) -> Floats:
    """Draw an arm at q (n,) [rad|m] as lines, a square at its base, dots at its ends; return its points (P, 3) [mm]."""
    segments = 1e3 * link_segments(model, q)
    links = len(model.link_names)
    for k, line in enumerate(segments):
        dot = {"marker": "o", "markersize": 1.2 * width} if k < links else {}
        axes.plot(*line.T, color=BLUE, linewidth=width, alpha=alpha, solid_capstyle="round", **dot)
    axes.plot(*np.zeros((3, 1)), "s", color=BLUE, markersize=2.4 * width, alpha=alpha)
    axes.plot(*segments[links:, 1].T, "o", color=ORANGE, markersize=2.4 * width, alpha=alpha)
    return np.vstack([np.zeros((1, 3)), segments.reshape(-1, 3)])


def equal_axes(axes: Any, points: Floats) -> tuple[Floats, float]:
    """Set equal scales and labels of 3D axes; return the centre (3,) and half the width [mm]."""
    from matplotlib.ticker import MaxNLocator

    middle: Floats = (points.max(axis=0) + points.min(axis=0)) / 2.0
    half = max(_MIN_EXTENT_MM, float(np.ptp(points, axis=0).max())) * 0.52
    for name, at in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(at - half, at + half)
        getattr(axes, f"set_{name}label")(f"{name} [mm]", fontsize=8)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=0.88)
    axes.tick_params(labelsize=7)
    return middle, half


def joints_by_unit(model: RobotModel) -> dict[str, list[int]]:
    """Return the indices of the joints by their torque unit, Nm or N."""
    units = [TORQUE_UNIT[unit] for unit in model.joint_units]
    return {unit: [j for j, own in enumerate(units) if own == unit] for unit in dict.fromkeys(units)}


def draw_torque_bars(places: Sequence[Any], model: RobotModel, q: Floats, tau: Floats) -> None:
    """Draw a bar for each joint's torque in the first row of tau (N, n) [Nm|N], and a line for the range of all."""
    for axes, (unit, joints) in zip(places, joints_by_unit(model).items(), strict=True):
        _draw_unit(axes, model, q, tau, unit, joints)


def _draw_unit(axes: Any, model: RobotModel, q: Floats, tau: Floats, unit: str, joints: Sequence[int]) -> None:
    rows = np.arange(len(joints))
    own, limits = tau[:, joints], model.effort_limit[list(joints)]
    reach = max(float(np.abs(own).max()), _ROUNDING_TORQUE)
    axes.barh(rows, own[0], height=0.5, color=BLUE)
    if len(own) > 1:
        axes.hlines(rows, own.min(axis=0), own.max(axis=0), color=_RANGE_COLOR, linewidth=1.2)
    shown = limits <= _SHOWN_LIMIT_BARS * reach
    for side in (-1.0, 1.0):
        axes.vlines(side * limits[shown], rows[shown] - 0.4, rows[shown] + 0.4, color=_LIMIT_COLOR, linewidth=1.5)
    # values are written beside the bars, so that short bars are readable
    lowest, highest = np.minimum(own.min(axis=0), 0.0), np.maximum(own.max(axis=0), 0.0)
    for row, (value, limit) in enumerate(zip(own[0], limits, strict=True)):
        share = f" ({100.0 * abs(value) / limit:.0f} % of {limit:g})" if np.isfinite(limit) else ""
        text = f"{value:.3g}{share}" if abs(value) > _ROUNDING_TORQUE else "0"
        end, where, away = (lowest[row], "right", -4.0) if value < 0.0 else (highest[row], "left", 4.0)
        box = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.8}
        style = {"fontsize": 8, "va": "center", "ha": where, "bbox": box}
        axes.annotate(text, (end, row), xytext=(away, 0.0), textcoords="offset points", **style)
    low, high = min([*lowest, *-limits[shown]]), max([*highest, *limits[shown]])
    # margin for the text at the ends, relative to the whole width
    written = _WIDE_TEXT_SHARE if np.isfinite(limits).any() else _SHORT_TEXT_SHARE
    margin = written if (own[0] < -_ROUNDING_TORQUE).any() else 0.02
    whole = (high - low) / (1.0 - margin - written) if high > low else 1.0
    axes.set_xlim(low - margin * whole, high + written * whole)
    axes.axvline(0.0, color=_RANGE_COLOR, linewidth=0.6)
    axes.set_yticks(rows, [_name(model, j, q[j]) for j in joints], fontsize=8)
    axes.set_ylim(len(joints) - 0.5, -0.5)
    axes.set_xlabel(f"[{unit}]{'; red: limit of the motor' if shown.any() else ''}", fontsize=8)
    axes.tick_params(axis="x", labelsize=7)
    axes.tick_params(axis="y", length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _name(model: RobotModel, joint: int, position: float) -> str:
    name = model.joint_names[joint]
    cut = name if len(name) <= _MAX_NAME_LENGTH else f"{name[: _MAX_NAME_LENGTH - 3]}..."
    return f"{joint + 1}  {cut}\n{in_words(position, model.joint_units[joint], 1)}"
