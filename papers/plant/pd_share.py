"""A target of the plant's refit: how much of the holding torque PD has to give at static poses on a tilted base.

Lewis, Hannaford 2014, "Dynamically evaluated gravity compensation for the RAVEN surgical robot", section V-A, figure 8:
poses along joint 1's range are held by PD and gravity compensation, on bases turned about joint 1's axis (z of the
mechanism's frame 0); the PD share is the RMS of the PD term over the RMS of all torque. DG takes the sensed gravity,
SG the level one. This is one number per robot and base, quickly got; figures 7 and 8 themselves, with every controller
and way of coming to a pose, are gravity_static.py's.
"""

from typing import NamedTuple

import numpy as np

from catenary import CablePlant, GravityPD, JointPD, JointState, Reference, load_robot, run_loop
from catenary.arrays import Floats
from catenary.control.gains import gains_at_joints
from catenary.control.loop import StateCorrector, Tick
from catenary.simulation.cable_parameters import CableArm, Firmware
from catenary.simulation.records import POSITIONING
from catenary.spatial import LEVEL
from catenary.trajectories.smoothed_path import BrokenLine, SmoothedPath
from papers.gravity.raven_base import turned_base

BASE_ANGLES_DEG = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
POSES_DEG = (*range(5, 90, 10), *range(75, 0, -10))  # of joint 1: along its range and back
MOVE, HOLD, LOOKED_AT = 1.0, 2.0, 1.0  # [s] between poses, at a pose, of it at its end
BLEND = 0.25  # [s] of setting off and stopping


class PDShare(NamedTuple):
    """What held the arm, per positioning joint."""

    share: Floats  # (3,) RMS of the PD term over RMS of the torque [%]
    torque: Floats  # (3,) RMS [Nm, Nm, N]
    pd: Floats  # (3,) RMS of the PD term


class HeldTool:
    """GravityPD on the positioning joints and PD on the tool's, whose links are without mass: the whole arm's joints.

    A corrector is fitted to all of them, so that the loop takes no less.
    """

    def __init__(self, firmware: Firmware, *, sensed: bool) -> None:
        """Take the firmware's own gains, and gravity as sensed (DG) or as on a level base (SG)."""
        kp, kd = gains_at_joints(firmware.kp, firmware.kd, firmware.ratio, firmware.gearbox)
        n = POSITIONING
        self._arm = GravityPD(load_robot("raven2"), kp[:n], kd[:n], gravity=None if sensed else LEVEL)
        self._tool = JointPD(kp[n:], kd[n:])
        self.feedback = self._arm.feedback  # (3,) the PD term of the last tick

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return the torques (7,) [Nm|N]."""
        n = POSITIONING
        ends = [
            part.torque(
                state._replace(q=state.q[of], qd=state.qd[of]),
                Reference(reference.q[of], reference.qd[of], reference.qdd[of]),
            )
            for part, of in ((self._arm, slice(n)), (self._tool, slice(n, None)))
        ]
        return np.concatenate(ends)


def poses_of_joint_1(start: Floats) -> SmoothedPath:
    """Return a path that holds joint 1 at each pose in turn; the other joints stay."""
    points, times = [float(start[0])], [0.0]
    for pose in np.deg2rad(POSES_DEG):
        times += [times[-1] + MOVE, times[-1] + MOVE + HOLD]
        points += [pose, pose]
    lines = [BrokenLine(times, points, BLEND)]
    return SmoothedPath(lines + [BrokenLine([0.0], [position], BLEND) for position in start[1:]])


def pd_share(arm: CableArm, base_deg: float, *, sensed: bool, corrector: StateCorrector | None = None) -> PDShare:
    """Hold all poses on a base turned about joint 1's axis, by DG or SG, at calibrated positions with a corrector."""
    plant = CablePlant(arm, substeps=1, base=turned_base(base_deg))
    plant.home()
    controller = HeldTool(plant.firmware, sensed=sensed)
    path = poses_of_joint_1(_believed_position(plant, corrector))
    seen: list[tuple[Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        into = tick.time % (MOVE + HOLD)
        if into > MOVE + HOLD - LOOKED_AT and tick.time < path.duration and tick.tau is not None:
            seen.append((controller.feedback.copy(), tick.tau[:POSITIONING]))

    run_loop(plant, controller, path, corrector=corrector, observers=[observe])
    pd, tau = (np.sqrt(np.mean(np.square(np.array(rows)), axis=0)) for rows in zip(*seen, strict=True))
    return PDShare(100.0 * pd / tau, tau, pd)


def _believed_position(plant: CablePlant, corrector: StateCorrector | None) -> Floats:
    """Return where the controller will find the joints, which is where the motion begins."""
    state = plant.measured_js()
    if corrector is None:
        return state.q
    q, inside = np.empty(len(state.q)), np.empty(len(state.q), dtype=bool)
    corrector.prepare(plant.joint_names, plant.joint_units, 1.0 / plant.period)
    corrector.correct_state(state, q, inside, np.empty(len(q)))
    return q
