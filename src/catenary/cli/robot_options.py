"""Robots as they are typed: descriptions and joints; which one commands move or read, on ROS or simulated here.

Joints are --q in rad and m, --q-deg in deg and mm.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import catenary
from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE
from catenary.cli.options import Names, Numbers, Six, Triple, argument, group, option
from catenary.cli.terminal import announce
from catenary.crtk.dialects import DIALECTS
from catenary.crtk.network import CARRIERS
from catenary.errors import InputError
from catenary.units import from_display

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.crtk.transport import Transport
    from catenary.gravity.closed_robot import ClosedRobot
    from catenary.plant import Bounded, Jointed
    from catenary.robots.model import Massless
    from catenary.workflows.robot.operated_robot import OperatedRobot


ROBOT = argument("ROBOT", "Catalogue name (see catenary robots), URDF, MJCF, TOML, or an identified .npz.")


@group
class DescriptionOptions:
    """Options of a robot's description that is not complete, or not possible."""

    massless: Names | None = option("LINK,...", "Links that have no mass: names, or all.")
    strict: bool = option(None, "Refuse impossible inertias instead of warning.", False)

    def declared(self) -> "Massless":
        """Return the links that are declared massless."""
        return "all" if self.massless == ("all",) else self.massless or ()

    def load(self, robot: str) -> "catenary.RobotModel":
        """Return the robot of a name or a file."""
        return catenary.load_robot(robot, massless=self.declared(), strict=self.strict)


@group
class LoadedOptions(DescriptionOptions):
    """Options of a robot's description, and of what the robot carries."""

    xacro: bool = option(None, "Expand a xacro file that you trust: this runs the Python in it.", False)
    payload: float = option("KG", "Mass that the robot carries.", 0.0, least=0.0)
    payload_on: str | None = option("FRAME", "Frame of the payload. [default: the tip]", goes_with="payload")
    payload_at: Triple = option("X,Y,Z", "Its centre of mass there, in m.", (0.0, 0.0, 0.0), goes_with="payload")
    payload_inertia: Six | None = option(
        "XX,XY,XZ,YY,YZ,ZZ", "Its inertia about that point, in kg m2. [default: a point mass]", goes_with="payload"
    )

    def load(self, robot: str) -> "catenary.RobotModel":
        """Return the robot of a name or a file, with what it carries."""
        return self._carrying(
            catenary.load_xacro(robot, massless=self.declared()) if self.xacro else super().load(robot)
        )

    def load_closed(self, robot: str) -> "ClosedRobot":
        """Return the robot of a file whose loops are no tree's, with what it carries."""
        from pathlib import Path

        from catenary.gravity.closed_robot import ClosedRobot
        from catenary.robots.catalog import load_open

        model = load_open(Path(robot), massless=self.declared())
        if self.strict and model.doubts:
            raise InputError(f'robot "{model.name}": {"; ".join(model.doubts)}')
        closed = ClosedRobot(model)
        closed.opened = self._carrying(closed.opened)
        return closed

    def _carrying(self, model: "catenary.RobotModel") -> "catenary.RobotModel":
        from catenary.gravity.payload import Payload

        if not self.payload:
            return model
        return Payload(self.payload, self.payload_on, self.payload_at, self.payload_inertia).on(model)


@group
class JointOptions:
    """Options of all joints' coordinates."""

    q: Numbers | None = option("Q,Q,...", "Joint coordinates in rad and m.")
    q_deg: Numbers | None = option("Q,Q,...", "The same in deg and mm.")

    def of(self, model: "catenary.RobotModel | ClosedRobot") -> "Floats":
        """Return them, (n,) in rad and m."""
        if (self.q is None) == (self.q_deg is None):
            from catenary.plant import joints_text

            joints = joints_text(model)
            raise InputError(
                f"{model.name}: give its {model.n} joints with --q (rad, m) or --q-deg (deg, mm): {joints}"
            )
        return some_joint_values(model, self.q, self.q_deg, model.joint_names)[0]

    def given(self, model: "catenary.RobotModel") -> "Floats | None":
        """Return them; None where neither option is given."""
        return None if self == JointOptions() else self.of(model)


def one_or_each(values: Numbers) -> float | Numbers:
    """Return the one number for all joints, or the numbers of each."""
    return values[0] if len(values) == 1 else values


def some_joint_values(
    robot: "Jointed", q: Numbers | None, q_deg: Numbers | None, names: Sequence[str] | None
) -> "tuple[Floats, Names]":
    """Return some joints from the option that was given, (k,) in rad and m, and their names.

    They are those named, else as many of the first as there are numbers.
    """
    import numpy as np

    from catenary.plant import Joints, joints_text

    option, values = ("--q", np.array(q)) if q_deg is None else ("--q-deg", np.array(q_deg))
    chosen = robot.joint_names[: len(values)] if names is None else tuple(names)
    unit_of = dict(zip(robot.joint_names, robot.joint_units, strict=True))
    unknown = [name for name in chosen if name not in unit_of]
    if unknown:
        raise InputError(f"--joints: {', '.join(unknown)}: expected some of {joints_text(robot)}")
    units = tuple(unit_of[name] for name in chosen)
    if len(chosen) != len(values) or not np.isfinite(values).all():
        wanted = joints_text(Joints(chosen, units))
        raise InputError(f"{option}: expected {len(chosen)} finite numbers for {wanted}, got {values.tolist()}")
    if q_deg is not None:
        values = np.array([from_display(value, unit) for value, unit in zip(values, units, strict=True)])
    return values, chosen


def beyond_limits(model: "Bounded", values: "Floats") -> list[str]:
    """Return a remark on each joint that is beyond its limits, or on one."""
    return [
        f"{name}: {value:g} {unit} is {'on a limit' if low <= value <= high else 'outside its limits'}, "
        f"{low:g} to {high:g} {unit}"
        for name, unit, value, low, high in zip(
            model.joint_names, model.joint_units, values, model.lower, model.upper, strict=True
        )
        if not low < value < high
    ]


NODE_NAME = option("NAME", "Name of this program's ROS node. [default: catenary_COMMAND_PID]")
CARRIER = option("|".join(CARRIERS), "ROS version of the messages.", "1", joins_ros=True)
DIALECT = option("|".join(DIALECTS), "With --ros: dialect of its topics. [default: the robot's own]", goes_with="ros")
_NAMESPACE = option("/NAME", "With --dialect crtk: namespace of the robot's topics.", goes_with="ros")
SIMULATED_SEED = option("N", "Simulate another robot of the kind. [default: the nominal one]", least=0)


@group
class NodeOptions:
    """Options of a program of its own on a network."""

    ros: str = CARRIER
    name: str | None = NODE_NAME

    def joined(self, command: str) -> "AbstractContextManager[Transport]":
        """Join it, under the name of the command where no other is given."""
        from catenary.crtk.network import make_transport, node_name

        return make_transport(self.ros, node_name(command, self.name))


@group
class RobotPlace:
    """Options of where a robot is: on ROS, or simulated here."""

    ros: int | None = option("1|2", "The robot is on ROS 1 or 2. [default: simulated here]", joins_ros=True)
    dialect: str | None = DIALECT
    namespace: str | None = _NAMESPACE
    name: str | None = replace(NODE_NAME, goes_with="ros")
    simulated: bool = option(None, "With --ros: the robot is simulated; no workspace to clear.", False, goes_with="ros")
    robot_seed: int | None = replace(SIMULATED_SEED, not_with="ros")


@group
class WatchedRobot(RobotPlace):
    """Options of a robot that is only read: which, and where it is."""

    robot: str = option("ROBOT", "raven2, raven2_right, another of the catalogue, or a robot file.", "raven2")
    base_tilt_deg: tuple[float, float] | None = replace(BASE_TILT, not_with="ros")


@group
class MovedRobot(WatchedRobot):
    """Options of a robot that is moved."""

    yes: bool = option(None, "With --ros: the workspace is clear; do not ask.", False, goes_with="ros")


@group
class PacedRobot(MovedRobot):
    """Options of a robot that is moved by itself, for which simulated time may run faster."""

    fast: bool = option(None, "Simulated: as fast as the machine allows, not in real time.", False, not_with="ros")


class TerminalGuide:
    """Asks in the terminal; Enter confirms, q cancels."""

    def say(self, text: str) -> None:
        """Show a message."""
        announce(text)

    def confirm(self, text: str) -> bool:
        """Wait for Enter."""
        print(f"{text}\n  [Enter] done   [q] cancel: ", end="", file=sys.stderr, flush=True)
        answer = sys.stdin.readline()
        return answer != "" and answer.strip().lower() not in ("q", "quit", "n", "no")


@contextmanager
def chosen_robot(
    chosen: WatchedRobot, command: str, *, moves: bool = True, homed: bool = True, gravity: str | None = None
) -> "Iterator[OperatedRobot]":
    """Open a robot for a command: simulated in this process, enabled and homed, or one on ROS, as it is."""
    from catenary.crtk.client import CrtkClient
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.reader import CrtkReader
    from catenary.open_robot import OverTopics, Simulated, tilted_base
    from catenary.workflows.robot.homing import clear_workspace
    from catenary.workflows.robot.operated_robot import operated_robot

    robot, simulated = chosen.robot, chosen.simulated
    if chosen.ros is None:
        where = Simulated(chosen.robot_seed, tilted_base(chosen.base_tilt_deg or LEVEL_BASE), homed=homed)
        yield operated_robot(robot, where, real_time=not (isinstance(chosen, PacedRobot) and chosen.fast))
        return
    asks = not simulated and not (isinstance(chosen, MovedRobot) and chosen.yes)
    with make_transport(str(chosen.ros), node_name(command, chosen.name)) as transport:
        is_read = not isinstance(chosen, MovedRobot)
        there = OverTopics(transport, chosen.dialect, chosen.namespace, simulated, gravity, only_read=is_read)
        opened = operated_robot(robot, there)
        client = cast(CrtkReader, opened.plant)
        with client:
            if moves and asks:
                clear_workspace(TerminalGuide())
            if isinstance(client, CrtkClient):
                client.require_free()
            yield opened
