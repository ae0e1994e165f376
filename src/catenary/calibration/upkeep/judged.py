"""Recordings judged before a model is held against them: what is wrong with the data is no fault of the model."""

from collections.abc import Collection, Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel, Card
from catenary.plant import MotionLog
from catenary.verdict.check import robot_of, verdict


def judge_recordings(
    model: CalibrationModel,
    card: Card,
    logs: Sequence[MotionLog],
    *,
    accept: Collection[str] = (),
    max_error: Floats | None = None,
    learning: bool = False,
    done: str = "evaluated",
) -> list[str]:
    """Refuse recordings of which a model's error would say nothing; return notes on what is worth knowing.

    Args:
        model: The model.
        card: Its card.
        logs: Of the model's joints.
        accept: Names of findings to go on with.
        max_error: (n,) [rad|m]; rows with larger errors are left out.
        learning: The model is to learn from them: they must not be short, nor the arm at rest.
        done: What was not done where they are refused.

    Raises:
        DataError: What was found in which recording, its likely cause, and the options that mend or accept it.
        InputError: An unknown name to accept.
    """
    return verdict(
        logs,
        accept=accept,
        robot=robot_of(logs, card.get("robot")),
        max_error=max_error,
        testing=not learning,
        trained=trained_positions(model),
        done=done,
    )


def trained_positions(model: CalibrationModel) -> tuple[Floats, Floats]:
    """Return the least and largest reported positions that a model was trained on, margins included, (n,) [rad|m].

    Infinite for a joint whose position no group of the model watches.
    """
    names = [f"q:{joint}" for joint in model.joint_names]
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for group in model.groups:
        for k, column in enumerate(group.watched):
            if (name := model.features.names[column]) in names:
                j = names.index(name)
                low[j], high[j] = group.valid_range.lower[k], group.valid_range.upper[k]
    return low, high
