"""What a program that is not ours sends over DDS and no robot should obey: nothing moves, and the arm says why."""

from typing import Any

import numpy as np
import pytest

from catenary.nodes.serve import Serving, make_server
from oracles.cable_arms import homed_plant
from oracles.cyclone_peer import JointState, Point, Pose, PoseStamped, Quaternion, Text
from patience import until

NAN, INF = float("nan"), float("inf")


def joints(q: np.ndarray) -> list[tuple[Any, str]]:
    """Commands of joints around q that are none, each with what is said of it."""

    def spoilt(value: float) -> list[float]:
        return [*q[:2].tolist(), value, *q[3:].tolist()]

    return [
        (JointState(position=spoilt(NAN)), "nan"),
        (JointState(position=spoilt(INF)), "inf"),
        (JointState(position=q[:3].tolist()), "3 numbers in `position`, expected 7"),
        (JointState(position=[*q.tolist(), 0.0, 0.0]), "9 numbers in `position`, expected 7"),
        (JointState(name=["shoulder"], position=q.tolist()), "7 numbers for 1 names"),
        (JointState(name=[f"joint{k}" for k in range(7)], position=q.tolist()), "unknown: joint0"),
        (JointState(velocity=q.tolist()), "0 numbers in `position`"),
    ]


def poses(q: np.ndarray) -> list[tuple[Any, str]]:
    """Commands of poses that are none."""
    return [
        (PoseStamped(pose=Pose(Point(NAN, 0.0, 0.0))), "nan"),
        (PoseStamped(pose=Pose(orientation=Quaternion(0.0, 0.0, 0.0, 0.0))), "expected length 1"),
        (PoseStamped(pose=Pose(orientation=Quaternion(NAN, 0.0, 0.0, 1.0))), "nan"),
        (PoseStamped(pose=Pose(Point(5.0, 0.0, 0.0))), "from the"),  # the base, or the setpoint
    ]


@pytest.mark.parametrize(
    ("verb", "kind", "bad"),
    [
        ("servo_jp", JointState, joints),
        ("move_jp", JointState, joints),
        ("servo_cp", PoseStamped, poses),
        ("move_cp", PoseStamped, poses),
    ],
)
def test_commands_that_are_none_move_nothing_and_the_arm_says_why(
    robot: Any, peer: Any, verb: str, kind: Any, bad: Any
) -> None:
    plant = homed_plant("left")
    server = make_server(Serving(dialect="crtk"), robot, plants={"gold": plant})
    topic, start = f"/arm1/{verb}", plant.setpoint_js().q
    writer, warnings = peer.writer(f"rt{topic}", kind), peer.reader("rt/arm1/warning", Text)

    def ticks(claim: Any) -> None:
        def tick_and_look() -> bool:
            server.tick()
            return bool(claim())

        until(tick_and_look, every=0.001)

    ticks(lambda: writer.get_publication_matched_status().current_count)
    ticks(lambda: server.publishers["warning", "gold"].heard)
    for message, reason in bad(start):
        server.reports.kinds.clear()  # of a streamed command one is told in 5 s; here each is looked at
        said: list[str] = []
        writer.write(message)
        ticks(lambda: said.extend(one.data for one in warnings.take(10)) or said)  # noqa: B023
        assert said[0].startswith(f"{topic}: refused: "), said
        assert reason in said[0]
        for _ in range(20):
            server.tick()
        np.testing.assert_array_equal(plant.setpoint_js().q, start)
        assert server.arms["gold"].state.state == "ENABLED"
    # the robot goes on
    if kind is JointState:
        goal = [start[0] + 0.01, *start[1:].tolist()]
        writer.write(JointState(position=goal))
        ticks(lambda: abs(plant.setpoint_js().q[0] - goal[0]) < 1e-6)
