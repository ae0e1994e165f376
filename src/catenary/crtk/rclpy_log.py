"""What catenary logs, said on ROS 2's `/rosout`."""

import logging
from typing import Any

from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile

_KEPT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # ROS 2's own of this topic


class Rosout(logging.Handler):
    """Says on `/rosout` what catenary logs."""

    def __init__(self, node: Any) -> None:
        """Begin to publish as a node."""
        super().__init__(logging.INFO)
        self._node, self._publisher = node, node.create_publisher(Log, "/rosout", _KEPT)

    def emit(self, record: logging.LogRecord) -> None:
        """Publish a record."""
        where = {"file": record.pathname, "function": record.funcName or "", "line": record.lineno}
        what = {"name": self._node.get_name(), "level": record.levelno, "msg": record.getMessage()}
        self._publisher.publish(Log(stamp=self._node.get_clock().now().to_msg(), **what, **where))
