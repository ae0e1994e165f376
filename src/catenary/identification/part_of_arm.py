"""Some joints of a longer arm: the others are held where recordings hold them, the rest is a robot of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from catenary.errors import InputError
from catenary.plant import JOINT_ARRAYS, Joints, MotionLog, joints_text, nameless, places_of
from catenary.robots.cut import lock_joints
from catenary.robots.model import RobotModel

STILL = {"rad": 0.02, "m": 0.005}  # by which a joint may move that is held


def part_of_arm(
    model: RobotModel, joints: Sequence[str], logs: Sequence[MotionLog]
) -> tuple[RobotModel, dict[str, float]]:
    """Return the robot of some joints alone, and where the others are held.

    Recordings that have the other joints too must hold them, all at one place. Where none has them they are at zero,
    or at the limit next to it.
    """
    places_of(Joints(tuple(joints)), model, whose=f'robot "{model.name}"', of="--joints are")
    held: dict[str, float] = {}
    for i, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True)):
        if name in joints:
            continue
        shown = [log.q_nominal[:, log.joint_names.index(name)] for log in logs if name in log.joint_names]
        where = np.concatenate(shown) if shown else np.clip(np.zeros(1), model.lower[i], model.upper[i])
        if np.ptp(where) > STILL[unit]:
            raise InputError(
                f"joint {name} is not among --joints, and moves from {where.min():.4g} to {where.max():.4g} {unit} "
                f"in the recordings: name it too, or take recordings that hold it (within {STILL[unit]:g} {unit})"
            )
        held[name] = float(np.clip(np.mean(where), model.lower[i], model.upper[i]))
    if not held:
        return model, held
    if model.actuation is not None:  # its numbers are what is sought
        model = replace(model, actuation=replace(model.actuation, values=None))
    return lock_joints(model, held), held


def require_held(logs: Sequence[MotionLog], held: Mapping[str, float]) -> None:
    """Refuse recordings that move joints which were held when an arm was identified, or hold them elsewhere."""
    for log in logs:
        for name, unit, q in zip(log.joint_names, log.joint_units, log.q_nominal.T, strict=True):
            if name in held and np.abs(q - held[name]).max() > STILL[unit]:
                raise InputError(
                    f'recording "{log.name}": joint {name} goes from {q.min():.4g} to {q.max():.4g} {unit}, and was '
                    f"held at {held[name]:.4g} when others were identified: expected it there, within {STILL[unit]:g}"
                )


def of_joints(log: MotionLog, model: RobotModel) -> MotionLog:
    """Return a recording of a robot's joints alone, those that it has beside them left out."""
    n = len(log.joint_names)
    if log.joint_names == nameless(n) and n == model.n:
        return log.in_order_of(model, of="--joints are")
    chosen = places_of(model, log, whose=f'recording "{log.name}"', of="--joints are")
    if n == len(chosen):
        return log.in_order_of(model, of="--joints are")
    arrays = {key: values[:, chosen] for key in JOINT_ARRAYS if (values := getattr(log, key)) is not None}
    left = [name for name in log.joint_names if name not in model.joint_names]
    notes = (*log.notes, f"joints left out: {joints_text(Joints(tuple(left)))}")
    return replace(log, joint_names=model.joint_names, joint_units=model.joint_units, notes=notes, **arrays)
