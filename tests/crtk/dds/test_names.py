import pytest

from catenary.crtk.dds import names
from catenary.recording.messages import MESSAGES, current_name


def test_topics_services_and_types_are_called_as_by_ros_2() -> None:
    # from ROS 2's design, "Topic and Service name mapping to DDS"
    assert names.dds_topic("/left/image_raw") == "rt/left/image_raw"
    assert names.request_topic("/add_two_ints") == "rq/add_two_intsRequest"
    assert names.reply_topic("/add_two_ints") == "rr/add_two_intsReply"
    assert names.dds_type("std_msgs/String") == "std_msgs::msg::dds_::String_"
    assert names.dds_half("std_srvs/Trigger", "Request") == "std_srvs::srv::dds_::Trigger_Request_"


@pytest.mark.parametrize("name", MESSAGES)
def test_names_are_read_back(name: str) -> None:
    assert names.ros_type(names.dds_type(name)) == current_name(name)
    assert names.ros_topic(names.dds_topic("/a/b")) == "/a/b"


def test_what_is_none_of_ros_is_left_as_it_is() -> None:
    assert names.ros_topic("ros_discovery_info") is None
    assert names.ros_topic("rq/add_two_intsRequest") is None
    assert names.ros_type("HelloWorldData::Msg") == "HelloWorldData::Msg"
