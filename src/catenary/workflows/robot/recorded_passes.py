"""A robot driven along a motion and recorded in passes: a recording that is cut off goes on from the last whole one.

A pass begins where the robot says that it is, not where it was sent: on a busy machine or network its messages come
late, now by a millisecond and in the next run by a third of a second. So the stretch that a pass leaves off with is
the one that the next begins with, whatever the delays of the two.
"""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.client import CrtkClient
from catenary.plant import JointState
from catenary.side_by_side import Progress
from catenary.trajectories.reference import GoneOn, Reference, Trajectory
from catenary.workflows.robot.motion import arrive, move_to, run_trajectory
from catenary.workflows.robot.topic_recorder import TopicRecorder

COLLECT_EVERY = 20  # ticks between two looks at what has come
PASS = 20.0  # [s] of a motion, which a recording that is cut off loses at most


def record_passes(
    client: CrtkClient, recorder: TopicRecorder, motion: GoneOn, *, joints: Sequence[str], progress: Progress
) -> None:
    """Drive joints of a homed, enabled robot along what is left of a motion, and record."""
    start, moved = motion(0.0).q, [client.joint_names.index(name) for name in joints]
    move_to(client, start, joints=joints)
    sent = np.array(client.setpoint_js().q)
    sent[moved] = start
    arrive(client, sent)
    place = _ReportedPlace(motion, client.period)
    tick, begun, next_pass = 0, False, motion.begin + PASS
    left = motion.duration / (motion.duration + motion.begin)

    def observe(_: JointState, reference: Reference, time: float) -> None:
        nonlocal tick, begun, next_pass, sent
        tick, sent = tick + 1, reference.q
        if tick % COLLECT_EVERY and (begun or time < motion.lead):
            return
        at = motion.begin - motion.lead + place.update(client.setpoint_js().q[moved], time)
        if not begun:
            recorder.pass_over()
            begun = at >= motion.begin and time > 0.0
            return
        recorder.collect()
        if at >= next_pass:
            recorder.journal.begin_pass(at)
            next_pass = at + PASS

    def share(done: float) -> None:
        progress(1.0 - (1.0 - done) * left)

    run_trajectory(client, motion, joints=joints, observe=observe, progress=share)
    arrive(client, sent)
    recorder.collect()


class _ReportedPlace:
    """How far along a motion a robot is by the setpoints that it reports: what was sent may still be on its way."""

    def __init__(self, motion: Trajectory, step: float) -> None:
        self._motion, self._step, self._time = motion, step, 0.0

    def update(self, setpoint: Floats, sent: float) -> float:
        """Return the time [s] of the motion at which the setpoint (k,) is nearest, `sent` at most; it only grows."""
        times = np.arange(self._time, sent + 0.5 * self._step, self._step)
        if len(times):
            away = np.abs(self._motion.sample(times)[0] - setpoint).max(axis=1)
            self._time = float(times[np.argmin(away)])
        return self._time
