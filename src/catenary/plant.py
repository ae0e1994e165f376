"""What every room shares about a robot in motion: the one log type."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, frozen
from catenary.errors import InputError

JOINT_UNITS = ("rad", "m")


@dataclass(frozen=True)
class MotionLog:
    """Rows of one or more recordings of the same robot, in the order in which they were taken.

    Joint arrays are (N, n) in the joints' units. `q_nominal` is what the robot reports or was commanded,
    through rigid cables; `q_encoder` is where the joints really were, true only on rows where `ok` is set.
    """

    name: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    q_nominal: Floats  # (N, n)
    ok: NDArray[np.bool_]  # (N,) rows whose q_encoder can be trusted
    q_encoder: Floats | None = None  # (N, n)
    time: Floats | None = None  # (N,) [s]
    qd: Floats | None = None  # (N, n) [rad/s or m/s]
    tau: Floats | None = None  # (N, n) [Nm or N]
    signals: Mapping[str, Floats] = field(default_factory=dict)  # further columns, each (N,)
    signal_units: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    simulated: bool = False
    sha256: str | None = None  # of the file that it was read from
    units_assumed: bool = False  # the file states no units and nobody else did
    notes: tuple[str, ...] = ()  # what the reader had to decide

    def __post_init__(self) -> None:
        rows, n = len(self), len(self.joint_names)
        where = f'recording "{self.name}"'
        if n == 0:
            raise InputError(f"{where}: has no joints, expected at least one")
        if len(set(self.joint_names)) != n:
            raise InputError(f"{where}: joint names must differ, got {list(self.joint_names)}")
        if len(self.joint_units) != n or any(unit not in JOINT_UNITS for unit in self.joint_units):
            raise InputError(
                f"{where}: expected {n} units, each rad or m, for joints {', '.join(self.joint_names)}; "
                f"got {list(self.joint_units)}"
            )
        if rows == 0:
            raise InputError(f"{where}: is empty, expected at least one row")
        for key in ("q_nominal", "q_encoder", "qd", "tau"):
            self._freeze(where, key, (rows, n))
        for key in ("time", "ok"):
            self._freeze(where, key, (rows,))
        if self.ok.dtype != np.bool_:
            raise InputError(f"{where}: ok: expected true or false on each row, got {self.ok.dtype}")
        for key, values in self.signals.items():
            if values.shape != (rows,):
                raise InputError(f'{where}: signal "{key}": expected shape ({rows},), got {values.shape}')
        object.__setattr__(self, "signals", {key: frozen(values) for key, values in self.signals.items()})
        if self.q_encoder is not None:
            bad = np.argwhere(~np.isfinite(self.q_encoder) & self.ok[:, None])
            if len(bad):
                row, joint = (int(i) for i in bad[0])
                raise InputError(
                    f"{where}: q_encoder of joint {self.joint_names[joint]} is "
                    f"{self.q_encoder[row, joint]} at row {row}, where ok is set ({len(bad)} such values); "
                    "clear ok on rows without a measurement"
                )

    def _freeze(self, where: str, key: str, shape: tuple[int, ...]) -> None:
        values = getattr(self, key)
        if values is None:
            return
        if values.shape != shape:
            raise InputError(f"{where}: {key}: expected shape {shape}, got {values.shape}")
        # q_encoder may hold anything where ok is not set
        if key not in ("q_encoder", "ok"):
            bad = np.argwhere(~np.isfinite(values))
            if len(bad):
                row = int(bad[0][0])
                raise InputError(
                    f"{where}: {key} is {values[tuple(bad[0])]} at row {row}; expected finite numbers "
                    f"({len(bad)} are not)"
                )
        object.__setattr__(self, key, frozen(values))

    def __len__(self) -> int:
        return len(self.q_nominal)

    @property
    def starts(self) -> tuple[int, ...]:
        """Rows where a recording begins: the first, and each whose time stamp goes back."""
        if self.time is None:
            return (0,)
        return (0, *(int(i) + 1 for i in np.flatnonzero(np.diff(self.time) < 0.0)))
