"""Recordings judged before a model is held against them: what is wrong with the data is no fault of the model."""

from collections.abc import Collection, Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card import valid_inputs
from catenary.calibration.model import CalibrationModel, Card
from catenary.errors import DataError
from catenary.plant import MotionLog
from catenary.recording.mend import AS_TRAINED, NOTHING, Mend
from catenary.verdict.check import robot_of, verdict
from catenary.verdict.units_and_scale import trained_findings


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
    try:
        return verdict(
            logs,
            accept=accept,
            robot=robot_of(logs, card.get("robot")),
            max_error=max_error,
            testing=not learning,
            trained=trained_positions(model),
            done=done,
        )
    except DataError as error:
        said = [f'"{log.name}" was {n}' for log in logs for n in log.notes if n.startswith(AS_TRAINED)]
        raise DataError("\n".join([str(error), *said]), error.names) from error


def mended_as_trained(model: CalibrationModel, log: MotionLog, own: Mend = NOTHING) -> MotionLog:
    """Return a recording mended as asked, and as a model's training data were; see `Mend`.

    Units of all arrays are mended so only where positions lie beyond the trained ones and would lie within: a
    recording that somebody has brought to rad and m since stays as it is.
    """
    trained = dict(model.mends)
    if "units" in trained and len(log.joint_names) == len(model.joint_names):
        other = trained_findings(model.matched(log), trained_positions(model))
        trained = trained if other else {key: texts for key, texts in trained.items() if key != "units"}
    return own(log, trained)


def trained_limits(
    card: Card, asked: tuple[float, ...] | None = None, *, as_trained: bool = True
) -> tuple[tuple[float, ...] | None, list[str]]:
    """Return the errors beyond which rows are left out, as asked or as in the model's fit [deg|mm], and a note."""
    found = card.get("run", {}).get("max_error") if as_trained and asked is None else None
    if found is None:
        return asked, []
    limits = tuple(np.inf if limit is None else float(limit) for limit in found)
    text = ",".join(f"{limit:g}" for limit in limits)
    return limits, [f"{AS_TRAINED}: --max-error {text}; --no-mend takes all rows"]


def trained_positions(model: CalibrationModel) -> tuple[Floats, Floats]:
    """Return the least and largest reported positions that a model was trained on, margins included, (n,) [rad|m].

    Infinite for a joint whose position no group of the model watches.
    """
    ranges, anywhere = valid_inputs(model), {"lower": -np.inf, "upper": np.inf}
    held = [ranges.get(f"q:{joint}", anywhere) for joint in model.joint_names]
    return np.array([each["lower"] for each in held]), np.array([each["upper"] for each in held])
