"""How ROS 2 calls things in DDS.

Topic `/arm1/measured_js` is DDS's `rt/arm1/measured_js`; requests of service `/silver_button` go over
`rq/silver_buttonRequest`, its answers over `rr/silver_buttonReply`. Type sensor_msgs/msg/JointState is
`sensor_msgs::msg::dds_::JointState_`. (ROS 2's design, "Topic and Service name mapping to DDS".)
"""

import re

from catenary.recording.messages import current_name

DISCOVERY = "ros_discovery_info"  # where each program tells which nodes it has; no topic of ROS
_TYPE = re.compile(r"(\w+)::msg::dds_::(\w+)_")


def dds_topic(topic: str) -> str:
    """Return DDS's name of a topic."""
    return f"rt{topic}"


def ros_topic(name: str) -> str | None:
    """Return the topic that DDS calls so, or None where it is none of ROS."""
    return name[2:] if name.startswith("rt/") else None


def request_topic(service: str) -> str:
    """Return DDS's name of the topic of a service's requests."""
    return f"rq{service}Request"


def reply_topic(service: str) -> str:
    """Return DDS's name of the topic of a service's answers."""
    return f"rr{service}Reply"


def dds_type(name: str) -> str:
    """Return DDS's name of a message type, or of a field's."""
    package, _, message = current_name(name).partition("/")
    return f"{package}::msg::dds_::{message}_"


def dds_half(service: str, half: str) -> str:
    """Return DDS's name of half a service type, which is `Request` or `Response`."""
    package, _, name = service.partition("/")
    return f"{package}::srv::dds_::{name}_{half}_"


def ros_type(name: str) -> str:
    """Return the message type that DDS calls so; a name that is none of ROS's as it is."""
    found = _TYPE.fullmatch(name)
    return current_name(f"{found[1]}/{found[2]}") if found else name
