"""Recordings read for a model: where they do not say their joints' names or units, the model does."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from catenary.archives import read_arrays
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.files import table_ending
from catenary.plant import MotionLog
from catenary.recording.foreign.mapping import RecordingMapping
from catenary.recording.foreign.read import Reading, read_recording
from catenary.recording.logs import read_log


def recordings_for(
    model: CalibrationModel | MotionLog, paths: Sequence[Path], reading: Reading | None = None
) -> list[MotionLog]:
    """Read recordings that a model is held against, by a mapping or as they are, and mend them.

    Args:
        model: The model, or a recording that one will be fitted to.
        paths: The recordings.
        reading: Mapping of recordings of another make, and what to change of them.

    Raises:
        FileFormatError: A recording is missing or damaged.
        InputError: There is none, or one has other joints.
    """
    reading = reading if reading is not None else Reading()
    if not paths:
        raise InputError("data: expected at least one recording, got none")
    if reading.mapping is None:
        logs = [reading.mend(read_recording_of(model, path)) for path in paths]
    else:
        logs = [_by_mapping(model, path, reading, reading.mapping) for path in paths]
    if isinstance(model, CalibrationModel):
        for log in logs:
            model.require_joints(log)
    return logs


def read_recording_of(model: CalibrationModel | MotionLog, path: Path) -> MotionLog:
    """Read a recording, taking a model's names and units where a bare command log does not state them.

    Args:
        model: The model, or a recording that one will be fitted to.
        path: The recording.

    Raises:
        InputError: The recording has another number of joints.
    """
    if table_ending(path) != ".npz":
        return read_log(path)
    content = read_arrays(path)
    commands = content.get("q_des")
    n = len(model.joint_names)
    if commands is not None and commands.ndim == 2 and commands.shape[1] != n:
        raise InputError(
            f"{path}: has {commands.shape[1]} joints; the model is for {n}: {', '.join(model.joint_names)}"
        )
    return read_log(
        path,
        units=None if "units" in content else model.joint_units,
        joint_names=None if "joint_names" in content else model.joint_names,
    )


def _by_mapping(
    model: CalibrationModel | MotionLog, path: Path, reading: Reading, mapping: RecordingMapping
) -> MotionLog:
    """Read a recording by a mapping; joints that have no names there are the model's, in order."""
    if not mapping.joint_units and mapping.robot is None:
        mapping = mapping.model_copy(update={"joint_units": model.joint_units})
    unmended = replace(reading, mapping=mapping, mend=Reading().mend)
    log = read_recording(path, unmended)
    n = len(log.joint_names)
    nameless = log.joint_names == tuple(f"J{j + 1}" for j in range(n)) and not mapping.joint_names
    if nameless and n == len(model.joint_names) and log.joint_names != model.joint_names:
        note = f"columns of q_nominal are {', '.join(model.joint_names)} of the model, in order"
        log = replace(log, joint_names=model.joint_names, notes=(*log.notes, note))
    return reading.mend(log)
