"""What the simulated RAVEN-II is fitted to, and what may move for it.

Peng et al.'s table I (direction J2-J3; raw, fixed offset, linear, polynomial; never the network's) pooled with hour 0
of their three sessions (section II-G); friction, following errors and tools of the recording of 2018. Held out:
the network, short training, loads, homing, all inputs, gravity. Two numbers that were chosen by hand have seen more:
`set_wander` the six hours, `idler_turns` the network.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.simulation.cable_parameters import CableArm
from papers.calibration import published

Numbers = Sequence[float | None]  # of joints 1, 2, 3; None where the paper has none
_HOURS = published.SIX_HOURS
# the paper's numbers that targets are means of, by method and by where they stand
_POOLED: dict[str, Mapping[str, Numbers]] = {
    "raw": {"table I": published.TABLE_1["J2-J3"]["raw"]},
    **{
        method: {"table I": published.TABLE_1["J2-J3"][method]}
        | {f"hour 0, {condition}": hours[method][0] for condition, hours in _HOURS.items()}
        for method in ("fixed offset", "linear", "network")
    },
    "polynomial": {"table I": published.TABLE_1["J2-J3"]["polynomial"]},
}
_MEANS: dict[str, tuple[float, ...]] = {
    method: tuple(np.nanmean(np.array([*numbers.values()], dtype=float), axis=0).round(4).tolist())
    for method, numbers in _POOLED.items()
}
HELD_OUT = {"network": _MEANS["network"]}  # pooled as the others are, so that like is held against like
TARGETS = {method: numbers for method, numbers in _MEANS.items() if method not in HELD_OUT}
_WANDER = "hour 5, unloaded"  # of which `set_wander` was chosen by hand, by the linear model's


def fitted_to(method: str, place: str) -> bool:
    """Say whether the simulated robot was fitted to a method's numbers at a place of the paper, "table I", "hour 0"."""
    pooled = _POOLED[method] if method in TARGETS else ()
    return any(each.startswith(place) for each in pooled) or (method, place) == ("linear", _WANDER)


CLOSE = 0.15  # a target is reached within this share of it
ALIKE = ("rotor_friction",)  # the three motor units are the same


class Free(NamedTuple):
    """One number that is fitted, or several that are the same, within what is plausible."""

    table: str  # of the data file
    field: str
    places: slice
    least: float
    most: float

    @property
    def name(self) -> str:
        """The field, and the joint or tool axis."""
        return self.field if self.places == slice(None) else f"{self.field}[{self.places.start}]"


def free_numbers(arm: CableArm) -> list[Free]:
    """Return the numbers of a data file that are fitted between bounds."""
    numbers = []
    for table in ("cable", "rig"):
        for field, entry in getattr(arm.file, table).items():
            if entry.origin != "fitted" or entry.least is None or entry.most is None:
                continue
            places = [slice(None)] if field in ALIKE else [slice(k, k + 1) for k in range(len(entry.value))]
            bounds = zip(places, entry.least, entry.most, strict=False)
            numbers += [Free(table, field, place, low, high) for place, low, high in bounds if high > low]
    return numbers


def shares_of(arm: CableArm, free: list[Free]) -> Floats:
    """Return where numbers stand between their bounds, (P,) 0 to 1."""
    now = [getattr(arm, each.table)[each.field][each.places].flat[0] for each in free]
    return np.array([(value - each.least) / (each.most - each.least) for value, each in zip(now, free, strict=True)])


def with_shares(arm: CableArm, free: list[Free], shares: Floats) -> CableArm:
    """Return the arm with some of its numbers put at shares (P,) of the way between their bounds."""
    changed = arm._replace(cable=arm.cable.copy(), rig=arm.rig.copy())
    for each, share in zip(free, shares, strict=True):
        getattr(changed, each.table)[each.field][each.places] = each.least + share * (each.most - each.least)
    return changed
