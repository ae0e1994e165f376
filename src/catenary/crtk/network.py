"""Joining a network of messages by its name."""

from catenary.crtk.dds.arguments import RosArguments, said_ros_arguments
from catenary.crtk.transport import Transport
from catenary.errors import InputError, MissingPackageError


def make_transport(ros: str, name: str) -> Transport:
    """Join ROS 1, ROS 2 as `said_ros_arguments` tells, or with "none" nothing beyond this program, as `name`.

    Raises:
        InputError: There is no such network, or what was said for ROS 2 goes with another.
        MissingPackageError: Its software is not installed.
        TransportError: It does not answer, or the name is taken.
    """
    said = said_ros_arguments()
    if ros != "2" and said != RosArguments():
        raise InputError(f"--ros-distro and --ros-args go with ROS 2, not with --ros {ros}")
    if ros == "1":
        from catenary.crtk.ros1.transport import Ros1Transport

        return Ros1Transport(name)
    if ros == "2":
        try:
            from catenary.crtk.dds.transport import DdsTransport
        except ImportError as error:
            raise MissingPackageError(
                f'ROS 2 is spoken by cyclonedds: pip install "catenary[ros2]" ({error})'
            ) from error
        return DdsTransport(name, arguments=said)
    if ros == "none":
        from catenary.crtk.loopback import Loopback

        return Loopback(name)
    raise InputError(f'ros "{ros}": expected 1, 2 or none')
