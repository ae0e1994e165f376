"""Every kind of robot, opened in every place: what it is, and what is refused, is the same for all commands."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.loopback import Loopback
from catenary.dvrk_psm import PSM_JOINTS
from catenary.errors import CatenaryError, FileFormatError, InputError, NotReadyError, UnsupportedModelError
from catenary.nodes.calibrated_topics import reader_of
from catenary.nodes.serve import Serving
from catenary.open_robot import KINDS, OverTopics, Simulated, open_robot, tilted_base
from catenary.plant import require_ready
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.sensing.gravity_vector import tilted_gravity
from catenary.simulation.joint_hardware import JointHardware
from catenary.workflows.gravity_trials import simulated_arm
from catenary.workflows.robot.operated_robot import operated_robot
from catenary.workflows.robot.operator_motion import go_to_joints
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import RobotOnLoopback, robot_over


@pytest.mark.parametrize(("dialect", "side"), [("raven", "left"), ("crtk", "right")])
def test_a_robot_behind_topics_is_moved_like_any_other(dialect: str, side: str) -> None:
    arm, name = ("gold", "raven2") if side == "left" else ("green", "raven2_right")
    setup = RobotOnLoopback(homed_plant(side), dialect=dialect, arm=arm)
    robot, client = robot_over(setup.transport, name, dialect=dialect, simulated=True)
    with client:
        goal = client.setpoint_js().q[:3] + np.array([0.02, -0.02, 0.002])
        summary = go_to_joints(robot, goal)
        assert_allclose(client.setpoint_js().q[:3], goal, atol=1e-6)  # a float's digits, on the wire
    assert summary.state.state == "PAUSED"


def test_a_simulated_base_may_be_tilted() -> None:
    plant = open_robot("raven2", Simulated(base=tilted_base((10.0, -5.0)), homed=False))
    expected = tilted_gravity(np.deg2rad(10.0), np.deg2rad(-5.0))
    assert_allclose(plant.measured_js().gravity, expected, atol=1e-12)


ROBOTS = [*KINDS, "planar_3r"]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_name_is_one_robot_whether_it_moves_or_is_asked_of_the_catalogue(name: str) -> None:
    pytest.importorskip("mujoco")
    robot, known = operated_robot(name, Simulated(homed=False), real_time=False), load_robot(name)
    assert (robot.name, robot.model.joint_names) == (name, known.joint_names)
    assert robot.plant.joint_names[:3] == known.joint_names[:3] or name in RAVEN_SIDES


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_that_was_opened_switched_off_is_not_moved(name: str) -> None:
    pytest.importorskip("mujoco")
    plant = open_robot(name, Simulated(homed=False))
    if name in KINDS:
        with pytest.raises(NotReadyError, match=r"not homed|DISABLED"):
            require_ready(plant, "servo_jp")
    homed = open_robot(name, Simulated())
    require_ready(homed, "servo_jp")
    homed.state_command("disable")
    with pytest.raises(NotReadyError, match="DISABLED"):
        homed.servo_jp(homed.setpoint_js().q)


def topics(**options: Any) -> OverTopics:
    return OverTopics(Loopback("client"), **options)


OPENED: dict[str, Callable[[str, Any], object]] = {"a robot": open_robot, "an operator's robot": operated_robot}
SIMULATED = {
    "an arm on a base": lambda robot, where: simulated_arm(
        robot, seed=where.seed, payload=where.payload, friction=None if where.hardware is None else 1.0
    ),
    "a served robot": lambda robot, where: Serving(robot, KINDS[robot].dialects[0], where),
}
UNSUPPORTED = [
    ("planar_3r", Simulated(seed=3), "has no seed, .*; raven2, raven2_right, dvrk_psm have one"),
    (
        "raven2",
        Simulated(hardware=JointHardware(friction=1.0)),
        "has no joint friction of choice; robots without cables have one",
    ),
    ("dvrk_psm", Simulated(payload=0.1), "has no payload"),
    ("dvrk_psm", Simulated(grav_dir=(0, 0, 980)), "has no grav_dir"),
]


@pytest.mark.parametrize("place", [*OPENED, *SIMULATED])
@pytest.mark.parametrize(("robot", "where", "message"), UNSUPPORTED)
def test_what_a_kind_cannot_have_is_refused_wherever_it_is_simulated(place, robot, where, message) -> None:
    if place == "an arm on a base" and where.grav_dir is not None:
        pytest.skip("it has no such option")
    if place == "a served robot" and robot not in KINDS:
        pytest.skip("it is not served")
    with pytest.raises(UnsupportedModelError, match=message):
        (OPENED | SIMULATED)[place](robot, where)


def test_a_ravens_model_alone_has_no_firmware_that_compensates_gravity() -> None:
    with pytest.raises(UnsupportedModelError, match="has no grav_dir"):
        open_robot(load_robot("raven2"), Simulated(grav_dir=(0, 0, 980)))


@pytest.mark.parametrize("place", OPENED)
@pytest.mark.parametrize(
    ("robot", "options", "error", "message"),
    [
        ("raven2", {"dialect": "latin"}, InputError, 'dialect "latin": expected one of raven, crtk'),
        ("dvrk_psm", {"dialect": "raven"}, InputError, "speaks crtk, not raven"),
        ("planar_3r", {"dialect": "raven"}, InputError, "speaks crtk, not raven"),
        ("dvrk_psm", {"namespace": "/MTML"}, InputError, "begins with PSM"),
        ("raven2", {"namespace": "/arm1"}, InputError, "the dialect raven has none"),
        ("nobody", {}, FileFormatError, "neither a file nor in the catalogue"),
    ],
)
def test_a_robot_that_is_not_behind_topics_is_refused(place, robot, options, error, message) -> None:
    with pytest.raises(error, match=message):
        OPENED[place](robot, topics(**options))


def test_a_deployed_model_and_a_served_robot_are_refused_the_same() -> None:
    for dialect, message in (("latin", "expected one of raven, crtk"), ("raven", "speaks crtk, not raven")):
        with pytest.raises(InputError, match=message):
            reader_of(PSM_JOINTS, Loopback("client"), "gold", dialect=dialect)
        with pytest.raises(InputError, match=message):
            Serving("dvrk_psm", dialect)  # type: ignore[arg-type]


def test_an_unknown_robot_is_told_by_the_catalogue() -> None:
    for opened in (*OPENED.values(), lambda robot, where: simulated_arm(robot)):
        with pytest.raises(CatenaryError, match="neither a file nor in the catalogue"):
            opened("nobody", Simulated())
