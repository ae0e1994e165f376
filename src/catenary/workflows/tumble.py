"""The tumble: a sensor by hand on each of its sides, then mounted on a base that is level, rolled, pitched."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.mounting import Mounting, TumbleSection
from catenary.sensing.tumble import align, fit_tumble, found_mounting, level_and_tilts
from catenary.sensing.vector import Mailbox
from catenary.simulation.base_motion import BaseSamples
from catenary.simulation.sensors import SensorModel, SimulatedSensor
from catenary.spatial import STANDARD_GRAVITY
from catenary.workflows.sense import SimulatedFeed, StillReading, read_still


class Attitude(NamedTuple):
    """How a person holds or mounts the sensor for a reading."""

    name: str
    instruction: str
    # the vertical in the sensor's printed axes, or, when mounted, where a simulated base has it
    up: tuple[float, float, float]
    mounted: bool = False


_HALF = 0.57735  # 1 / sqrt(3)
SIDES = (
    Attitude("+x up", "hold the sensor still with its x axis up", (1, 0, 0)),
    Attitude("-x up", "turn it over: x axis down", (-1, 0, 0)),
    Attitude("+y up", "its y axis up", (0, 1, 0)),
    Attitude("-y up", "its y axis down", (0, -1, 0)),
    Attitude("+z up", "its z axis up", (0, 0, 1)),
    Attitude("-z up", "its z axis down", (0, 0, -1)),
)
SLANTED = (
    Attitude("slanted 1", "slanted, any way you like", (_HALF, _HALF, _HALF)),
    Attitude("slanted 2", "slanted another way", (-_HALF, _HALF, -_HALF)),
    Attitude("slanted 3", "slanted a third way", (_HALF, -_HALF, -_HALF)),
)
_TILT = "by 10 degrees or more"
MOUNTED = (
    Attitude("level", "mount it on the robot's base; base level", (0, 0, 1), mounted=True),
    Attitude("rolled", f"tilt the base about its x axis {_TILT}, y side up", (0, 0.34202, 0.93969), mounted=True),
    Attitude(
        "pitched", f"level again, then tilt it about its y axis {_TILT}, x side down", (-0.34202, 0, 0.93969),
        mounted=True,
    ),
)  # fmt: skip
ATTITUDES = (*SIDES, *SLANTED, *MOUNTED)


@dataclass(frozen=True)
class TumbleOutcome:
    """Result of a tumble: a mounting, and the faults that forbid its use."""

    mounting: Mounting
    section: TumbleSection
    faults: tuple[str, ...]


def run_tumble(read: Callable[[Attitude], StillReading], *, start: Mounting | None = None) -> TumbleOutcome:
    """Go through all attitudes and compute bias, scale, rotation and the gyroscope's bias.

    The sides show a wrong sign or order of axes against those printed on the sensor; the slanted attitudes leave a
    residual; the mounted ones give the rotation, from the base's level and two tilts that nobody needs to measure.

    Args:
        read: Returns the reading of an attitude, once the sensor is held so.
        start: What is known already: position, ranges, name.

    Raises:
        SensorError: From `read`.
        InputError: The base was not tilted.
    """
    readings = {attitude.name: read(attitude) for attitude in ATTITUDES}
    by_hand = np.array([readings[s.name].force for s in (*SIDES, *SLANTED)])
    sides = np.array([s.up for s in SIDES], dtype=float)
    fit = fit_tumble(by_hand)
    faults = list(fit.faults)
    # a unit that is wrong says nothing about axes; sides that are missing may
    if not fit.faults or fit.missing:
        faults += [f"on its sides: {f}" for f in align(by_hand[:6], sides, expected=np.eye(3)).faults]
    mounted = [readings[s.name].force for s in MOUNTED]
    corrected = [(y - fit.bias) / fit.scale for y in mounted]
    rows, up = level_and_tilts(*corrected)
    rough = align(rows[:2], up[:2]).rotation  # two directions never show a mirror; the third then does
    alignment = align(rows, up, expected=rough)
    if not faults and alignment.faults:  # the sensor is right, so the base was tilted otherwise
        faults += [f"on the base: was it tilted as told, y side up, then x side down? {f}" for f in alignment.faults]
    rates = [r.rate for r in readings.values() if r.rate is not None]
    mounting = found_mounting(start, alignment.rotation, fit.bias, fit.scale, rates)
    section = TumbleSection(
        readings=len(readings),
        residual_m_s2=None if np.isnan(fit.residual) else fit.residual,
        rotation_residual_deg=alignment.residual_deg,
        remarks=tuple(faults),
    )
    return TumbleOutcome(mounting, section, tuple(faults))


class StillBase:
    """A base at rest, with gravity (3,) [m/s2] in its axes."""

    def __init__(self, gravity: Floats) -> None:
        self._gravity = gravity

    def sample(self, times: Floats) -> BaseSamples:
        """Return one row, which holds at all times."""
        return BaseSamples(self._gravity[None, :], np.zeros((1, 3, 3)))


def simulated_reader(model: SensorModel, *, seed: int = 0) -> Callable[[Attitude], StillReading]:
    """Return a function that reads a simulated sensor in an attitude, as if a person held it so."""

    def read(attitude: Attitude) -> StillReading:
        up = np.array(attitude.up, dtype=float)
        gravity = -STANDARD_GRAVITY * up / np.linalg.norm(up)
        if not attitude.mounted:
            gravity = model.mounting.rotation @ gravity
        number = [s.name for s in ATTITUDES].index(attitude.name)
        sensor = SimulatedSensor(StillBase(gravity), Mailbox(), model, seed=seed + number)
        return read_still(SimulatedFeed(sensor))

    return read
