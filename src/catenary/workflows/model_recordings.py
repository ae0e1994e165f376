"""Recordings read for a model: what they do not say of their joints, and how they are mended, the model does."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from catenary.archives import read_arrays
from catenary.calibration.model import CalibrationModel
from catenary.calibration.upkeep.judged import mended_as_trained
from catenary.errors import InputError
from catenary.files import table_ending
from catenary.plant import Joints, MotionLog, nameless
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.logs import Reading, read_log, read_recording


def recordings_for(
    model: CalibrationModel | MotionLog, paths: Sequence[Path], reading: Reading | None = None
) -> list[MotionLog]:
    """Read recordings that a model is held against; see `recording_for`.

    Args:
        model: The model, whose joints they then are of, in its order; or a recording that one will be fitted to.
        paths: The recordings.
        reading: Mapping of recordings of another make, and what to change of them.

    Raises:
        FileFormatError: A recording is missing or damaged.
        InputError: There is none, or one has other joints.
    """
    if not paths:
        raise InputError("data: expected at least one recording, got none")
    logs = [recording_for(model, path, reading) for path in paths]
    return [model.matched(log) for log in logs] if isinstance(model, CalibrationModel) else logs


def recording_for(
    model: CalibrationModel | MotionLog | None, path: Path, reading: Reading | None = None
) -> MotionLog:
    """Read a recording, by a mapping or as it is, and mend it as asked, and as the model's training data were.

    Names and units of joints are the model's where the recording states none.

    Args:
        model: The model, or a recording that one will be fitted to; None reads it by itself.
        path: The recording.
        reading: Mapping of a recording of another make, what to change, and whether a model's mends count.

    Raises:
        FileFormatError: It is missing or damaged.
        InputError: It has another number of joints.
    """
    reading = reading if reading is not None else Reading()
    if model is None:
        return read_recording(path, reading)
    log = (
        _read(model, path) if reading.mapping is None else _by_mapping(model, path, reading, reading.mapping)
    )
    n, names = len(log.joint_names), model.joint_names
    if log.joint_names == nameless(n) and n == len(names) and not set(log.joint_names) & set(names):
        log = log.in_order_of(Joints(names), of="the model is for")  # which its mends name
    if isinstance(model, CalibrationModel) and reading.as_trained:
        return mended_as_trained(model, log, reading.mend)
    return reading.mend(log)


def _read(model: CalibrationModel | MotionLog, path: Path) -> MotionLog:
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
    """Read a recording by a mapping; joints without units there have the model's."""
    if not mapping.joint_units and mapping.robot is None:
        mapping = mapping.model_copy(update={"joint_units": model.joint_units})
    return read_recording(path, replace(reading, mapping=mapping, mend=Reading().mend))
