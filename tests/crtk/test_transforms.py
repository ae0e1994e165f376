"""Where a frame is by /tf and /tf_static, against poses composed by SciPy."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class
from catenary.crtk.message_values import pose_message
from catenary.crtk.transforms import TransformTree, heard_pose, recorded_pose
from catenary.errors import InputError
from catenary.spatial import Pose
from command_line import catenary, refusal
from lab_bags import Message, write_bag

TF = message_class("tf2_msgs/TFMessage")
# as vectors of rotation and places; the sensor hangs on a plate beside the arm, both on a cart
LINKS = {
    "base_link": ("cart", [0.0, 0.0, 0.5], [0.1, 0.0, 0.4]),
    "plate": ("cart", [0.3, 0.0, 0.0], [0.0, 0.2, 0.3]),
    "imu_link": ("plate", [0.0, -0.7, 0.1], [0.02, 0.0, 0.01]),
    "hand": ("base_link", [0.0, 0.1, 0.0], [0.5, 0.0, 0.0]),
}


def matrix(turn, place):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), place
    return T


def told(names, shift=0.0):
    poses = {n: Pose(Rotation.from_rotvec(LINKS[n][1]).as_matrix(), np.array(LINKS[n][2]) + shift) for n in names}
    return TF(tuple(pose_message(pose, 0, LINKS[n][0], child=n) for n, pose in poses.items()))


TRUE = np.linalg.inv(matrix(*LINKS["base_link"][1:])) @ matrix(*LINKS["plate"][1:]) @ matrix(*LINKS["imu_link"][1:])


def assert_true(pose):
    assert_allclose(pose.rotation, TRUE[:3, :3], atol=1e-12)
    assert_allclose(pose.position, TRUE[:3, 3], atol=1e-12)


def test_transforms_are_followed_up_and_down_and_a_frame_that_moves_or_is_not_there_is_refused():
    tree = TransformTree()
    tree.add(told(LINKS))
    tree.add(told(["hand"], shift=0.1))
    assert_true(tree.pose("base_link", "imu_link"))
    with pytest.raises(InputError, match='"hand" moves against "base_link", at hand'):
        tree.pose("base_link", "hand")
    with pytest.raises(InputError, match='from "base_link" to "imu"; frames: base_link, cart, hand, imu_link, plate'):
        tree.pose("base_link", "imu")


def test_published_transforms_are_waited_for():
    network = LoopbackNetwork()
    robot, node = Loopback("robot", network), Loopback("node", network)
    robot.publisher("/tf_static", "tf2_msgs/TFMessage", latch=True).publish(told(["base_link", "plate"]))
    robot.publisher("/tf", "tf2_msgs/TFMessage", latch=True).publish(told(["imu_link"]))
    assert_true(heard_pose(node, "base_link", "imu_link"))


def test_a_replayed_bag_tells_where_its_sensor_is(tmp_path: Path) -> None:
    def transforms(store: Any, head: Any) -> Any:
        types, made = store.types, []
        for child, (parent, turn, place) in LINKS.items():
            header = types["std_msgs/msg/Header"](**{**vars(head), "frame_id": parent})
            vector = types["geometry_msgs/msg/Vector3"](*place)
            quaternion = types["geometry_msgs/msg/Quaternion"](*Rotation.from_rotvec(turn).as_quat().tolist())
            transform = types["geometry_msgs/msg/Transform"](vector, quaternion)
            made.append(types["geometry_msgs/msg/TransformStamped"](header, child, transform))
        return types["tf2_msgs/msg/TFMessage"](made)

    def reading(k: int) -> Message:
        def make(store: Any, head: Any) -> Any:
            vector, turn = store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"]
            noise = 0.01 * np.sin([k, 1.3 * k + 1.0, 1.7 * k])
            force, nine = TRUE[:3, :3].T @ [0.0, 0.0, 9.81] + noise, np.zeros(9)
            gyro, accel = vector(*(0.1 * noise)), vector(*force)
            return store.types["sensor_msgs/msg/Imu"](head, turn(0.0, 0.0, 0.0, 1.0), nine, gyro, nine, accel, nine)

        return 0.02 * k, "/imu", make

    topics = {"/imu": "sensor_msgs/msg/Imu", "/tf_static": "tf2_msgs/msg/TFMessage"}
    bag = write_bag(tmp_path / "imu", "mcap", topics, [(0.0, "/tf_static", transforms), *map(reading, range(40))])
    assert_true(recorded_pose(bag, "base_link", "imu_link"))
    line = ("sense", "--replay", bag, "--imu-frame")
    found = catenary(*line, "tf:base_link:imu_link", "--json").json
    assert found["base"] == "base_link"
    assert_allclose(found["mean"], [0.0, 0.0, -9.81], atol=0.02)
    assert "expected tf:BASE:FRAME" in refusal(*line, "tf:imu_link")
