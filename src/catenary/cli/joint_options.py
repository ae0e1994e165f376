"""Joints as they are typed: --q in rad and m, --q-deg in deg and mm."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.terminal import numbers
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.plant import Jointed
    from catenary.robots.model import RobotModel

Q = Annotated[str | None, Option("--q", metavar="Q,Q,...", help="Joint coordinates in rad and m.")]
QDeg = Annotated[str | None, Option("--q-deg", metavar="Q,Q,...", help="Joint coordinates in deg and mm.")]

SameInDeg = Annotated[str | None, Option("--q-deg", metavar="Q,Q,...", help="The same in deg and mm.")]


def joint_values(model: "RobotModel", q: str | None, q_deg: str | None) -> "Floats":
    """Read all joints of a robot from one of the two options, (n,) in rad and m."""
    if (q is None) == (q_deg is None):
        raise InputError(
            f"{model.name}: give its {model.n} joints with --q (rad, m) or --q-deg (deg, mm): "
            f"{names_and_units(model)}"
        )
    return some_joint_values(model, q, q_deg, model.joint_names)[0]


def given_joints(model: "RobotModel", q: str | None, q_deg: str | None) -> "Floats | None":
    """Read all joints of a robot from one of the two options, (n,) in rad and m; None when neither is given."""
    return None if q is None and q_deg is None else joint_values(model, q, q_deg)


def some_joint_values(
    robot: "Jointed", q: str | None, q_deg: str | None, names: Sequence[str] | None
) -> "tuple[Floats, tuple[str, ...]]":
    """Read some joints from the option that was given, (k,) in rad and m, and their names.

    Args:
        robot: Whose joints.
        q: Of --q.
        q_deg: Of --q-deg.
        names: Which joints; as many of the first as there are numbers when None.
    """
    import numpy as np

    option, text = ("--q", q) if q_deg is None else ("--q-deg", q_deg)
    values = np.array(numbers(option, text or ""))
    chosen = robot.joint_names[: len(values)] if names is None else tuple(names)
    unknown = [name for name in chosen if name not in robot.joint_names]
    if unknown:
        raise InputError(f"--joints: {', '.join(unknown)}: expected some of {names_and_units(robot)}")
    if len(chosen) != len(values) or not np.isfinite(values).all():
        raise InputError(
            f"{option}: expected {len(chosen)} finite numbers for {names_and_units(robot, chosen)}, "
            f"got {values.tolist()}"
        )
    if q_deg is not None:
        units = np.array([robot.joint_units[robot.joint_names.index(name)] for name in chosen])
        values = np.where(units == "rad", np.deg2rad(values), values / 1000.0)
    return values, chosen


def names_and_units(robot: "Jointed", names: Sequence[str] | None = None) -> str:
    """Return joints with their units, all or those that are named."""
    return ", ".join(
        f"{name} [{unit}]"
        for name, unit in zip(robot.joint_names, robot.joint_units, strict=True)
        if names is None or name in names
    )


def beyond_limits(model: "RobotModel", values: "Floats") -> list[str]:
    """Return a remark on each joint that is beyond its limits, or on one."""
    return [
        f"{name}: {value:g} {unit} is {'on a limit' if low <= value <= high else 'outside its limits'}, "
        f"{low:g} to {high:g} {unit}"
        for name, unit, value, low, high in zip(
            model.joint_names, model.joint_units, values, model.lower, model.upper, strict=True
        )
        if not low < value < high
    ]
