"""Recordings judged before a model is held against them: what is wrong with the data is no fault of the model."""

from collections.abc import Collection, Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card import valid_inputs
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
    ranges, anywhere = valid_inputs(model), {"lower": -np.inf, "upper": np.inf}
    held = [ranges.get(f"q:{joint}", anywhere) for joint in model.joint_names]
    return np.array([each["lower"] for each in held]), np.array([each["upper"] for each in held])
