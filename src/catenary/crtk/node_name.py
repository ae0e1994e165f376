"""Names of programs on a network of messages: unique unless somebody chooses one, so that several run side by side."""

import os
import re

from catenary.errors import InputError


def node_name(program: str, given: str | None = None) -> str:
    """Return a program's name: the one given, else catenary_PROGRAM_PID, as catenary_monitor_12345.

    ROS 1 ends the older of two programs of one name.
    """
    if given is None:
        return f"catenary_{re.sub(r'[^A-Za-z0-9_]', '_', program)}_{os.getpid()}"
    if not re.fullmatch(r"/?[A-Za-z]\w*", given, re.ASCII):
        raise InputError(f'--name "{given}": expected a letter, then letters, digits and underscores')
    return given.removeprefix("/")
