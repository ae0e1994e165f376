"""The state of a simulated arm, saved and restored: what a real one keeps by standing there."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import read_arrays
from catenary.documents import cut, json_table, shortened
from catenary.errors import FileFormatError
from catenary.files import written_whole
from catenary.simulation.firmware_plant import FirmwarePlant
from catenary.simulation.records import Record

STATE_FORMAT = "catenary.cable_plant.1"
_MAX_MAGNITUDE = 1e10  # of counts, random numbers, radians, metres, newtons and newton metres in an arm
_UNSAVED_FIELD = "gravity_torque"  # of the firmware: zero while disabled
AnyArm = FirmwarePlant[Any]


def save_plant(plant: AnyArm, path: Path) -> None:
    """Write where an arm stands and what its firmware knows; not its parameters, which follow from its seed."""
    arrays = {key: record[name] for key, record, name in _saved(plant)} | plant.registered
    about = _robot(plant) | {"tick": plant.ticks, "is_homed": plant.operating_state().is_homed}
    with written_whole(path) as file:
        np.savez(file, about=np.array(json.dumps(about)), **arrays)


def restore_plant(plant: AnyArm, path: Path) -> None:
    """Put an arm back where `save_plant` left it, disabled."""
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file; no state of the robot was saved there")
    wanted = _robot(plant)
    try:
        arrays = read_arrays(path)
        about = json_table(str(arrays["about"]), f"{path}: about")
        found = {key: about[key] for key in wanted}
    except (FileFormatError, KeyError) as error:
        raise _unreadable(path, error) from error
    if found != wanted:
        raise FileFormatError(f"{path}: is of another robot: {cut(str(found))}, expected {wanted}")
    try:
        values = [_like(arrays[key], record[name], name) for key, record, name in _saved(plant)]
        registered = {name: _like(arrays[name], now, name) for name, now in plant.registered.items()}
        tick, is_homed = about.get("tick"), about.get("is_homed")
        if type(tick) is not int or not 0 <= tick < 2**53 or not isinstance(is_homed, bool):
            raise ValueError(f"tick {shortened(tick)}, is_homed {shortened(is_homed)}")
    except (KeyError, ValueError) as error:
        raise _unreadable(path, error) from error
    for value, (_, record, name) in zip(values, _saved(plant), strict=True):
        record[name] = value
    plant.resume_at(tick, registered, is_homed=is_homed)


def _saved(plant: AnyArm) -> list[tuple[str, Record, str]]:
    """Return what is saved of an arm: its name in the file, its record and its field there."""
    records = {"arm": plant.state, "control": plant.control}
    return [
        (f"{part}.{name}", record, name)
        for part, record in records.items()
        for name in record.fields
        if name != _UNSAVED_FIELD
    ]


def _unreadable(path: Path, error: Exception) -> FileFormatError:
    why = str(error).removeprefix(f"{path}: ") if isinstance(error, FileFormatError) else cut(repr(error))
    return FileFormatError(
        f"{path}: is no state of a simulated robot that this version reads ({why}); if another version "
        "saved it, home again: `catenary home PROJECT`"
    )


def _like(values: NDArray[Any], now: Any, name: str) -> NDArray[Any]:
    """Return values of the shape of those of now, NaN only where these are, no larger than anything in an arm."""
    if values.dtype.kind not in "biuf" or values.shape != np.shape(now):
        raise ValueError(f"{name}: {values.dtype} of shape {values.shape}, expected numbers of {np.shape(now)}")
    is_right = np.abs(values) < _MAX_MAGNITUDE
    if np.asarray(now).dtype.kind == "f":
        is_right |= np.isnan(values) & np.isnan(now)
    if not is_right.all():
        raise ValueError(f"{name}: {cut(str(values))}, expected numbers below {_MAX_MAGNITUDE:g}")
    return values


def _robot(plant: AnyArm) -> dict[str, object]:
    """Return everything that makes an arm another one, or makes it stand elsewhere."""
    return {"format": STATE_FORMAT, **plant.identity, "base": repr(plant.base)}
