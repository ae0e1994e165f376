"""Designed motions as files."""

import io
from pathlib import Path

import numpy as np

from catenary.errors import FileFormatError
from catenary.files import write_atomically
from catenary.identification.excitation import Excitation
from catenary.robots.model import RobotModel


def write_excitation(design: Excitation, model: RobotModel, path: Path) -> None:
    """Write poses or a motion: `.npz` with `t`, `q`, `dq`, `ddq`, `joint_names`, `units`, or `.csv` of the same.

    Raises:
        FileFormatError: Another ending, or the file cannot be written.
    """
    if path.suffix == ".npz":
        buffer = io.BytesIO()
        np.savez(
            buffer,
            allow_pickle=False,
            t=design.time,
            q=design.q,
            dq=design.qd,
            ddq=design.qdd,
            joint_names=np.array(model.joint_names),
            units=np.array(model.joint_units),
        )
        write_atomically(path, buffer.getvalue())
    elif path.suffix == ".csv":
        header = ["t", *(f"{kind}:{name}" for kind in ("q", "dq", "ddq") for name in model.joint_names)]
        rows = np.column_stack([design.time, design.q, design.qd, design.qdd])
        lines = [",".join(header), *(",".join(repr(float(v)) for v in row) for row in rows)]
        write_atomically(path, ("\n".join(lines) + "\n").encode())
    else:
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected .npz or .csv')
