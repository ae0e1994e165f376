"""What a simulated arm reports besides its joint state: the columns of its telemetry."""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Column
from catenary.simulation.base_motion import BaseSamples, imu_reading
from catenary.simulation.cable_parameters import Rig
from catenary.simulation.packed import CONTROL, CONTROL_WHOLE, control_of

if TYPE_CHECKING:
    from catenary.simulation.cable_plant import CablePlant

COLUMNS = (
    Column("encVals", "counts", 7),
    Column("mpos", "rad", 7),
    Column("mvel", "rad/s", 7),
    Column("jpos", "rad|m", 7),
    Column("jvel", "rad/s|m/s", 7),
    Column("jpos_d", "rad|m", 7),
    Column("mpos_d", "rad", 7),
    Column("tau", "Nm at the gearbox's output", 7),
    Column("dac_val", "DAC", 7),
    Column("encoffsets", "counts", 7),
    Column("joint_enc", "counts", 3),
    Column("ext_jpos", "rad|m", 3),
    Column("q_true", "rad|m", 3),
    Column("accelerometer", "m/s2", 3),
    Column("gyroscope", "rad/s", 3),
)

# name in telemetry: field of the firmware's state
CONTROL_FIELDS = {
    "encVals": "counts",
    "mpos": "motor",
    "mvel": "motor_velocity",
    "jpos": "joint",
    "jvel": "joint_velocity",
    "jpos_d": "setpoint",
    "mpos_d": "motor_setpoint",
    "tau": "torque",
    "dac_val": "dac",
    "encoffsets": "offset",
}


def _place(field: str) -> slice:
    """Where a field of the firmware's state lies among its numbers."""
    numbers = control_of(np.arange(CONTROL, dtype=float), np.zeros(CONTROL_WHOLE, dtype=np.int64))
    first = int(getattr(numbers, field)[0])
    return slice(first, first + 7)


_PLACES = {column: _place(field) for column, field in CONTROL_FIELDS.items()}


class Sample(Mapping[str, Floats]):
    """Every column at one instant; each is worked out when it is asked for, which most are not in most ticks."""

    def __init__(self, plant: "CablePlant", control: Floats, base: BaseSamples) -> None:
        """Take the firmware's numbers, which it keeps, and how the base moves now, one row."""
        self._control, self._base = control, base
        self._q, self._rig, self._zero = plant.state.q.copy(), plant.rig, plant.rig_zero

    def __getitem__(self, name: str) -> Floats:
        """Give a column."""
        place = _PLACES.get(name)
        return self._control[place] if place is not None else _OTHERS[name](self)

    def __iter__(self) -> Iterator[str]:
        """Give the columns' names."""
        return (column.name for column in COLUMNS)

    def __len__(self) -> int:
        """How many columns there are."""
        return len(COLUMNS)

    def _counts(self) -> Floats:
        return rounded_counts(self._rig, self._q)


_OTHERS: dict[str, Callable[[Any], Floats]] = {
    "joint_enc": lambda of: of._counts(),
    "ext_jpos": lambda of: reported_positions(of._rig, of._zero, of._counts()),
    "q_true": lambda of: of._q,
    # an ideal one at the base's origin, in base axes
    "accelerometer": lambda of: imu_reading(of._base)[0][0].copy(),
    "gyroscope": lambda of: imu_reading(of._base)[1][0].copy(),
}


def rounded_counts(rig: Rig, q: Floats) -> Floats:
    """Counts of the external encoders at true joint positions (..., 3)."""
    return np.round(q * rig.counts)


def reported_positions(rig: Rig, zero: Floats, counts: Floats) -> Floats:
    """Joint positions that the rig reports, (..., 3) [rad, rad, m]; NaN before it is registered."""
    positions: Floats = rig.registered + (counts - zero) / rig.counts
    return positions
