"""Recordings of positions, velocities and torques, read for identification."""

from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.plant import MotionLog
from catenary.recording.importers import numbers_of, read_arrays
from catenary.recording.logs import read_parquet
from catenary.robots.model import RobotModel


def read_torque_log(path: Path, model: RobotModel) -> MotionLog:
    """Read a recording of a robot: a `.parquet` motion log, or a `.npz` of positions and torques.

    Arrays of the `.npz`: `q` (N, n) in rad and m, `tau` (N, n) in Nm and N, `dq` (N, n) if recorded, and `fs` [Hz] or
    `t` (N,) [s] if the robot moves. `effort` (N, n) in place of `tau` is what the robot reports raw; the robot's file
    then gives the torque per unit of it.

    Raises:
        FileFormatError: No such file, unknown kind, damaged, or an array is missing.
        InputError: Wrong shape, NaN, a rate that is not above zero, or raw efforts of a robot without scale.
    """
    if path.suffix == ".parquet":
        if not path.is_file():
            raise FileFormatError(f"{path}: no such file")
        return read_parquet(path)
    if path.suffix != ".npz":
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected a recording, .npz or .parquet')
    content = read_arrays(path)

    def numbers(key: str, dimensions: int) -> Floats:
        return numbers_of(path, content, key, dimensions)

    if "q" not in content or not {"tau", "effort"} & set(content):
        raise FileFormatError(
            f"{path}: expected arrays q (N, n) and tau (N, n), and dq, fs or t where the robot moves; "
            f"this file has {', '.join(content) or 'none'}"
        )
    q = numbers("q", 2)
    notes: tuple[str, ...] = ()
    if "tau" in content:
        tau = numbers("tau", 2)
    else:
        tau = numbers("effort", 2)
        scale = None if model.actuation is None else model.actuation.effort_scale
        if scale is None or tau.shape[1] != len(scale):
            raise InputError(
                f'{path}: has raw efforts, and robot "{model.name}" gives no effort_scale for its '
                f"{tau.shape[1]} joints; expected an array tau [Nm or N]"
            )
        tau = tau * scale
        notes = ("raw efforts times the robot's effort_scale",)
    time = None
    if "t" in content:
        time = numbers("t", 1)
    elif "fs" in content:
        rate = float(numbers("fs", 0))
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"{path}: fs is {rate}: expected a rate above zero [Hz]")
        time = np.arange(len(q)) / rate
    known = q.shape[1] == model.n  # another number of joints is refused by name when it is used
    return MotionLog(
        name=path.stem,
        joint_names=model.joint_names if known else tuple(f"J{i + 1}" for i in range(q.shape[1])),
        joint_units=model.joint_units if known else ("rad",) * q.shape[1],
        q_nominal=q,
        ok=np.ones(len(q), dtype=bool),
        time=time,
        qd=numbers("dq", 2) if "dq" in content else None,
        tau=tau,
        robot=model.name,
        sha256=sha256_of(path),
        notes=notes,
    )
