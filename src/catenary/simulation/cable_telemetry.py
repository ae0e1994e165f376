"""A simulated RAVEN-II's ticks as the robot reports them: raven_state's fields in SI; a parked arm's are zero."""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.raven2.topics import ARM_OF_SIDE, in_channels
from catenary.simulation.cable_plant import REPORTED, CablePlant
from catenary.simulation.firmware import TickLog, joint_torques

RUNNING = 3  # run level: pedal down
# name in telemetry: field of a tick's log, which has no offsets of the encoders
PER_AXIS = {name: field for name, (field, _) in REPORTED.items() if name != "encoffsets"}
COLUMNS = (
    *PER_AXIS, "encoffsets", "runlevel", "type", "dt", "pos", "ori", "ext_jpos", "joint_enc",
    "measured_js", "measured_js_velocity", "measured_js_effort",
)  # fmt: skip


def as_reported(plant: CablePlant, values: Floats) -> Floats:
    """Return values with the digits that the robot's messages have."""
    return values.astype(plant.arm.file.reported).astype(np.float64)


def of_both_arms(
    plant: CablePlant, log: TickLog, beside: CablePlant | None, log_beside: TickLog | None
) -> dict[str, Floats]:
    """Return `telemetry_of` an arm with the channels and the pose of another beside it, of the same ticks."""
    columns = telemetry_of(plant, log)
    if beside is not None and log_beside is not None:
        others = telemetry_of(beside, log_beside)
        columns |= {name: columns[name] + others[name] for name in (*PER_AXIS, "encoffsets", "pos", "ori")}
    return columns


def telemetry_of(plant: CablePlant, log: TickLog) -> dict[str, Floats]:
    """Return T ticks of a run as telemetry: column name to (T, width), SI.

    `pos` and `ori` are the tool's pose in the arm's frame 0, as the robot believes it from its motors.
    """
    ticks = len(log.joint)
    side = ARM_OF_SIDE[plant.side]
    columns = {name: in_channels(side, as_reported(plant, getattr(log, field))) for name, field in PER_AXIS.items()}
    columns["encoffsets"] = in_channels(side, np.tile(plant.control.offset, (ticks, 1)))
    columns["runlevel"] = np.full((ticks, 1), float(RUNNING))
    columns["type"] = np.zeros((ticks, 2))
    columns["dt"] = np.full((ticks, 1), plant.period)
    arm = tuple(ARM_OF_SIDE).index(plant.side)
    base, q = plant.model.frames["frame0"].pose, np.column_stack([log.joint[:, :5], 0.5 * np.diff(log.joint[:, 5:])])
    rotation, position = forward_kinematics(plant.model, q)
    positions, rotations = np.zeros((ticks, 2, 3)), np.zeros((ticks, 2, 3, 3))  # of both arms
    positions[:, arm], rotations[:, arm] = (position - base.position) @ base.rotation, base.rotation.T @ rotation
    columns["pos"], columns["ori"] = positions.reshape(ticks, 6), rotations.reshape(ticks, 18)
    columns["joint_enc"] = plant.encoders.counts(log.q)
    columns["ext_jpos"] = plant.encoders.positions(columns["joint_enc"])
    columns["measured_js"] = log.joint
    columns["measured_js_velocity"] = log.joint_velocity
    columns["measured_js_effort"] = joint_torques(plant.firmware, log.torque)
    return columns
