"""The robot as recordings show it: with bodies that its file lacks, and drives that two joints share."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catenary.arrays import Floats
from catenary.identification.explanations.columns import Supposed
from catenary.identification.explanations.evidence import Evidence
from catenary.identification.identification import CarriedBody
from catenary.identification.identify_options import actuation_of
from catenary.robots.actuation import Friction, MotorInertia
from catenary.robots.model import RobotModel

_BODY_RADIUS_M = 0.05  # of the ball that a body is taken for, whose own inertia torques hardly show
_LEAST_SIGMAS = 1.0  # that a body's mass lies above zero


def arm_as_found(
    model: RobotModel, found: Sequence[tuple[Evidence, Supposed]]
) -> tuple[RobotModel, tuple[CarriedBody, ...]]:
    """Return a robot with what explains its recordings, and the bodies that are part of its masses now.

    Args:
        model: The robot as its file has it.
        found: Each recording's evidence, and what it supposes. A drive is taken from any of them; a body only where all
            carry one on the same link, as masses would be those of one recording otherwise.
    """
    drives = dict.fromkeys(drive for _, supposed in found for drive in supposed.shared)
    for drive in drives:
        model = _with_shared_drive(model, *drive)
    bodies = list[CarriedBody]()
    for link in found[0][1].loads if found else ():
        if all(link in supposed.loads for _, supposed in found):
            shown = [load_body(evidence, supposed, link) for evidence, supposed in found]
            body, std = np.mean([each for each, _ in shown], axis=0), max(std for _, std in shown)
            if body[0] > _LEAST_SIGMAS * std:
                bodies.append(_carried_body(model, link, body))
                model = bodies[-1].on(model)
    return model, tuple(bodies)


def _with_shared_drive(model: RobotModel, i: int, j: int, sign: float) -> RobotModel:
    """Return a robot with friction and a rotor on q_i + sign q_j, and a rotor on each of the two joints."""
    actuation, eye, names = actuation_of(model), np.eye(model.n), model.joint_names
    along, name = eye[i] + sign * eye[j], f"{names[i]} {'+' if sign > 0.0 else '-'} {names[j]}"
    own = [MotorInertia(names[k], eye[k]) for k in (i, j) if not any(r.combination[k] for r in actuation.motor_inertia)]
    return replace(
        model,
        actuation=replace(
            actuation,
            values=None,
            friction=(*actuation.friction, Friction(name, along, offset=False)),
            motor_inertia=(*actuation.motor_inertia, *own, MotorInertia(name, along)),
        ),
    )


def _carried_body(model: RobotModel, link: int, body: Floats) -> CarriedBody:
    """Return a body (10,) of a link as one on the tip, or in the link's own frame."""
    tip = model.frame()
    name, pose = (model.tip, tip.pose) if tip.link == link else (model.link_names[link], None)
    place = body[1:4] / body[0]
    place = place if pose is None else pose.rotation.T @ (place - pose.position)
    ball = 0.4 * float(body[0]) * _BODY_RADIUS_M**2
    return CarriedBody(name, float(body[0]), tuple(place.tolist()), (ball, 0.0, 0.0, ball, 0.0, ball))


def load_body(evidence: Evidence, supposed: Supposed, link: int) -> tuple[Floats, float]:
    """Return the parameters (10,) of a body on a link that is supposed to carry one, and its mass' deviation [kg]."""
    _, which = evidence.over_spreads(supposed)
    load = evidence.belief.load
    body, unsure = evidence.body(link, load, evidence.fit(supposed, which), which, supposed.loads)
    return load @ body, float(load[0, 0] * np.sqrt(max(unsure[0, 0], 0.0)))
