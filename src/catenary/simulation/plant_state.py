"""The state of a simulated arm, saved and restored: what a real one keeps by standing there."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from catenary.errors import FileFormatError
from catenary.files import written_whole
from catenary.simulation.cable_plant import CablePlant

FORMAT = "catenary.cable_plant.1"
FLAGS = ("braked", "stopped", "guarded")  # of the firmware, one array in the file


def save_plant(plant: CablePlant, path: Path) -> None:
    """Write where an arm stands and what its firmware knows; not its parameters, which follow from its seed.

    Raises:
        FileFormatError: The file cannot be written.
    """
    arrays: dict[str, Any] = {f"arm.{name}": plant.state[name] for name in plant.state.fields}
    arrays |= {f"control.{name}": plant.control[name] for name in plant.control.fields if name not in FLAGS}
    arrays["control.flags"] = np.array([plant.control[name] for name in FLAGS], dtype=np.int64)
    arrays["rig_zero"] = plant.encoders.zero
    about = _robot(plant) | {
        "tick": plant.ticks,
        "is_homed": plant.operating_state().is_homed,
    }
    with written_whole(path) as file:
        np.savez(file, about=np.array(json.dumps(about)), **arrays)


def restore_plant(plant: CablePlant, path: Path) -> None:
    """Put an arm back where `save_plant` left it, disabled.

    Raises:
        FileFormatError: No such file, damaged, or of another robot.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            wanted = _robot(plant)
            found = {key: about[key] for key in wanted}
            if found != wanted:
                raise FileFormatError(f"{path}: is of another robot: {found}, expected {wanted}")
            for name in plant.state.fields:
                plant.state[name] = file[f"arm.{name}"]
            flags = dict(zip(FLAGS, file["control.flags"], strict=True))
            for name in plant.control.fields:
                plant.control[name] = flags[name] if name in flags else file[f"control.{name}"]
            plant.resume_at(int(about["tick"]), file["rig_zero"], is_homed=bool(about["is_homed"]))
    except FileFormatError:
        raise
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file; no state of the robot was saved there") from error
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise FileFormatError(
            f"{path}: is no state of a simulated robot that this version reads ({error!r}); if another version "
            "saved it, home again: `catenary home PROJECT`"
        ) from error


def _robot(plant: CablePlant) -> dict[str, object]:
    """Return everything that makes an arm another one, or makes it stand elsewhere."""
    return {
        "format": FORMAT,
        "side": plant.side,
        "seed": plant.seed,
        "payload": plant.payload,
        "base": repr(plant.base),
    }
