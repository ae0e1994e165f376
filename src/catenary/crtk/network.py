"""Joining ROS 1, ROS 2 or nothing by its name, under a name of the program's own."""

import logging
import os
import re
from importlib import import_module
from importlib.util import find_spec

from catenary.crtk.dds.arguments import RosArguments, said_ros_arguments
from catenary.crtk.transport import Transport
from catenary.errors import InputError, MissingPackageError, to_install

# whose rclpy does not say which program sent a message: a served arm could not refuse a second one there
_TELLING_NO_SENDER = ("humble", "iron", "jazzy")
_logger = logging.getLogger(__name__)


def make_transport(ros: str, name: str) -> Transport:
    """Join ROS 1, ROS 2 as `said_ros_arguments` tells, or with "none" nothing beyond this program, as `name`."""
    said = said_ros_arguments()
    if ros != "2" and said != RosArguments():
        raise InputError(f"--transport, --ros-distro and --ros-args go with ROS 2, not with --ros {ros}")
    if ros == "1":
        from catenary.crtk.ros1.transport import Ros1Transport

        return Ros1Transport(name)
    if ros == "2":
        if (by_rclpy := _rclpy_transport(name, said)) is not None:
            return by_rclpy
        try:
            from catenary.crtk.dds.transport import DdsTransport
        except ImportError as error:
            raise MissingPackageError(f"ROS 2 is spoken by cyclonedds: {to_install('ros2')} ({error})") from error
        return DdsTransport(name, arguments=said)
    if ros == "none":
        from catenary.crtk.loopback import Loopback

        return Loopback(name)
    raise InputError(f'ros "{ros}": expected 1, 2 or none')


def _rclpy_transport(name: str, said: RosArguments) -> Transport | None:
    """Join ROS 2 by rclpy, where that is asked for, or not excluded and possible."""
    if said.transport == "dds" or (said.transport is None and said.distro is not None):
        return None
    if said.transport is None and os.environ.get("ROS_DISTRO") in _TELLING_NO_SENDER:
        return None
    if said.distro is not None:
        raise InputError("--ros-distro: does not go with --transport rclpy, which is of one distribution")
    try:
        from catenary.crtk.rclpy_transport import RclpyTransport

        import_module("crtk_msgs.msg")  # without it no state can be told
    except ImportError as error:
        if said.transport == "rclpy":
            raise MissingPackageError(
                f"--transport rclpy: {error}. Source the setup of a ROS 2 for this Python, and of crtk_msgs"
            ) from error
        if find_spec("rclpy") is not None:
            _logger.warning("ROS 2 by DDS, not by the rclpy that is there: %s", error)
        return None
    if os.environ.get("ROS_DISTRO") in _TELLING_NO_SENDER:
        _logger.warning("this rclpy does not tell who sent a message: of two programs that command, none is refused")
    return RclpyTransport(name, arguments=said)


def node_name(program: str, given: str | None = None) -> str:
    """Return the name that was given, else catenary_PROGRAM_PID: ROS 1 ends the older of two programs of one name."""
    if given is None:
        return f"catenary_{re.sub(r'[^A-Za-z0-9_]', '_', program)}_{os.getpid()}"
    if not re.fullmatch(r"/?[A-Za-z]\w*", given, re.ASCII):
        raise InputError(f'--name "{given}": expected a letter, then letters, digits and underscores')
    return given.removeprefix("/")
