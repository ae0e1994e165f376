"""A simulated robot put away and taken out again: what a real one keeps by standing there."""

import json
import zipfile
from pathlib import Path

import numpy as np

from catenary.errors import FileFormatError
from catenary.simulation.cable_plant import CablePlant

FORMAT = "catenary.cable_plant.1"


def save_plant(plant: CablePlant, path: Path) -> None:
    """Write where an arm stands and what its firmware knows; not its parameters, which follow from its seed."""
    arrays = {f"arm.{name}": values for name, values in plant.state._asdict().items()}
    arrays |= {f"control.{name}": values for name, values in plant.control._asdict().items()}
    arrays["rig_zero"] = plant.rig_zero
    about = _robot(plant) | {
        "tick": plant.ticks,
        "is_homed": plant.operating_state().is_homed,
    }
    np.savez(path, about=np.array(json.dumps(about)), **arrays)


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
            for name, values in plant.state._asdict().items():
                values[:] = file[f"arm.{name}"]
            for name, values in plant.control._asdict().items():
                values[:] = file[f"control.{name}"]
            plant.resume_at(int(about["tick"]), file["rig_zero"], is_homed=bool(about["is_homed"]))
    except FileFormatError:
        raise
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file; the robot was not put away there") from error
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise FileFormatError(
            f"{path}: is no state of a simulated robot that this version reads ({error!r}); where another version "
            "left it, home again: `catenary home PROJECT`"
        ) from error


def _robot(plant: CablePlant) -> dict[str, object]:
    """Everything that makes an arm another one, or makes it stand elsewhere."""
    return {
        "format": FORMAT,
        "side": plant.side,
        "seed": plant.seed,
        "payload": plant.payload,
        "base": repr(plant.base),
    }
