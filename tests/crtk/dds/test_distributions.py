import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.dds.distributions import DISTRIBUTIONS, distribution, half_hash, message_hash
from catenary.errors import InputError
from catenary.recording.messages import SERVICES

STORES = {"humble": Stores.ROS2_HUMBLE, "iron": Stores.ROS2_IRON, "jazzy": Stores.ROS2_JAZZY}


@pytest.mark.parametrize("name", STORES)
def test_the_number_of_a_program_has_the_size_that_the_distribution_defines(name: str) -> None:
    ((_, (_, (_, length))),) = get_typestore(STORES[name]).fielddefs["rmw_dds_common/msg/Gid"][1]
    assert distribution(name).gid == length


def test_hashes_are_those_that_ros2_topic_info_prints() -> None:
    # std_msgs/String: ROS 2's documentation; sensor_msgs/JointState: `ros2 topic info --verbose` of robots
    string = "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    joints = "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    assert message_hash("std_msgs/String") == f"RIHS01_{string}"
    assert message_hash("sensor_msgs/JointState") == f"RIHS01_{joints}"


def test_halves_of_services_have_hashes_of_their_own() -> None:
    hashes = {half_hash(service, half) for service in SERVICES for half in ("Request", "Response")}
    assert len(hashes) == 2 * len(SERVICES)


def test_the_distribution_is_the_one_given_else_the_one_sourced_else_the_default(monkeypatch) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert distribution().name == "jazzy"
    monkeypatch.setenv("ROS_DISTRO", "humble")
    assert distribution().name == "humble"
    assert distribution("iron").name == "iron"
    monkeypatch.setenv("ROS_DISTRO", "noetic")  # ROS 1's
    assert distribution().name == "jazzy"


def test_another_distribution_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=f'"foxy": expected one of {", ".join(DISTRIBUTIONS)}'):
        distribution("foxy")
