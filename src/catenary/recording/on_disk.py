"""Recordings whose arrays lie on disk: of a hundred long ones memory then holds the one that is looked at.

Each array is a file that is mapped into memory, read-only; the system drops its pages when it needs them. The files are
in a folder of their own under /var/tmp, or where TMPDIR says, and go when the program ends.
"""

import os
import tempfile
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.errors import InputError
from catenary.plant import JOINT_ARRAYS, MotionLog

_numbers = count()


@cache
def _folder() -> "tempfile.TemporaryDirectory[str]":
    lasting = None if "TMPDIR" in os.environ or not os.path.isdir("/var/tmp") else "/var/tmp"
    return tempfile.TemporaryDirectory(prefix="catenary-", dir=lasting)


def on_disk(log: MotionLog) -> MotionLog:
    """Return a recording with its arrays on disk, bit for bit the same.

    Raises:
        InputError: The disk is full.
    """

    def kept(array: NDArray[Any]) -> NDArray[Any]:
        path = Path(_folder().name) / f"{next(_numbers)}.npy"
        try:
            np.save(path, array)
            mapped: NDArray[Any] = np.load(path, mmap_mode="r")
        except OSError as error:
            raise InputError(
                f'recording "{log.name}": {path.parent} cannot hold it: {error.strerror}; name another folder by TMPDIR'
            ) from error
        return mapped

    arrays: dict[str, Any] = {
        name: kept(array) for name in (*JOINT_ARRAYS, "time", "ok") if (array := getattr(log, name)) is not None
    }
    return replace(log, **arrays, signals={name: kept(values) for name, values in log.signals.items()})
