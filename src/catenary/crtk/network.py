"""Joining a network of messages by its name."""

from catenary.crtk.transport import Transport
from catenary.errors import InputError


def make_transport(ros: str, name: str) -> Transport:
    """Join ROS 1, ROS 2, or with "none" nothing beyond this program, as `name`.

    Raises:
        InputError: There is no such network.
        MissingPackageError: Its software is not installed.
        TransportError: It does not answer, or the name is taken.
    """
    if ros == "1":
        from catenary.crtk.ros1.transport import Ros1Transport

        return Ros1Transport(name)
    if ros == "2":
        from catenary.crtk.ros2.transport import Ros2Transport

        return Ros2Transport(name)
    if ros == "none":
        from catenary.crtk.loopback import Loopback

        return Loopback(name)
    raise InputError(f'ros "{ros}": expected 1, 2 or none')
