"""The peers over six unloaded hours: trained on the zig-zags and tested on the motions of figures 6 and 7.

Robot, zig-zags and random motion are those of six_hours.py; the motion is sampled at 30 Hz in place of 2 Hz, since the
recurrent network and the filter have a memory, and errors are taken on every 15th row. Training: 1/2 + 1/3 + 1/4. The
recurrent network takes the paper's 16 inputs now and 0.4, 0.8, 1.2 and 1.6 s ago, as far apart as Hwang's commands.
"""

from collections.abc import Sequence

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from papers.calibration.inputs import SIXTEEN
from papers.calibration.peers.elastic_joints import Filter, identified
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.recurrent import fit_recurrent
from papers.calibration.peers.rows import Peer, joined, rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase
from papers.calibration.recordings import at_rows
from papers.calibration.six_hours import DENOMINATORS, HOUR, joint_rmse, recorded, tip_rmse
from papers.experiment import Case, Outcomes, Plain, Result, Scope, run

UKF, UKF_TOLD = "Kalman filter", "Kalman filter, true stiffness"
RECURRENT, PROCESS, TWO_PHASE = "recurrent", "Gaussian process", "two-phase"
PEERS = (UKF, UKF_TOLD, RECURRENT, PROCESS, TWO_PHASE)
TRAINING = "1/2+1/3+1/4"
RATE, EVERY = 30.0, 15  # [Hz] of the tests, and rows from one that counts to the next
SPACING = 12  # rows between the commands of a sequence
TRAININGS = 3  # of the recurrent network, the process and the forest at most, whose errors are averaged


@run(revision=1)
def peer_hours(
    seed: int | None,
    trainings: Sequence[int],
    training: str,
    effort: float,
    zigzags: Sequence[int] = DENOMINATORS,
    hour_seconds: float = HOUR,
) -> Result:
    """Record a robot's unloaded session, fit every peer, and test it in every hour.

    Args:
        effort: Share of the recurrent network's steps, the process's rows and the forest's trees; 1 but to see that it
            runs.

    Returns:
        By peer, a list with an entry for each hour: `errors`, RMSE on J1 [deg], J2 [deg], J3 [mm]; `tip`, RMSE of the
        tool tip in x, y, z and distance [mm]. Under "identified", the filter's stiffness.
    """
    session = recorded(seed, "unloaded", zigzags=zigzags, hour_seconds=hour_seconds, test_rate=RATE)
    logs = session.training(training)
    rows = joined([rows_of_log(log, SIXTEEN) for log in logs])
    joints = identified(logs)
    filters = {UKF: Filter(joints), UKF_TOLD: Filter(identified(logs, CablePlant(seed=seed).arm.cable.stiffness))}
    fits: dict[str, list[Peer]] = {
        RECURRENT: [
            fit_recurrent(rows, seed=each, spacing=SPACING, iterations=round(5000 * effort)) for each in trainings
        ],
        PROCESS: [
            fit_gaussian_process(rows, seed=each, carried=round(1000 * effort), chosen=round(300 * effort))
            for each in trainings
        ],
        TWO_PHASE: [fit_two_phase(rows, seed=each, trees=round(100 * effort)) for each in trainings],
    }
    results: dict[str, list[Plain]] = {name: [] for name in PEERS}
    for log in session.test.values():
        at = np.arange(EVERY - 1, len(log), EVERY)
        few, all_rows = at_rows(log, at), rows_of_log(log, SIXTEEN)
        for name, one in filters.items():
            results[name].append(_tested(few, [one.correction(log)[at]]))
        for name, peers in fits.items():
            results[name].append(_tested(few, [peer.correction(all_rows, at) for peer in peers]))
    return {**results, "identified": {"stiffness": [round(float(k), 1) for k in joints.stiffness]}}


def _tested(log: MotionLog, corrections: Sequence[Floats]) -> dict[str, Plain]:
    error = np.asarray(log.q_encoder) - log.q_nominal
    rows = [[*joint_rmse(error - each), *tip_rmse(log, error - each)] for each in corrections]
    mean = [round(float(value), 6) for value in np.mean(rows, axis=0)]
    return {"errors": mean[:3], "tip": mean[3:]}


def peer_cases(scope: Scope) -> list[Case]:
    """Return a case for every robot; the quick one takes seconds."""
    few = {"zigzags": [2], "hour_seconds": 60.0} if scope.quick else {}
    return [
        peer_hours.case(
            seed=seed,
            trainings=scope.networks_of(seed)[:TRAININGS],
            training="1/2" if scope.quick else TRAINING,
            effort=0.02 if scope.quick else 1.0,
            **few,
        )
        for seed in scope.robots
    ]


def peer_errors(o: Outcomes, peer: str, kind: str = "errors") -> Floats:
    """Return what was measured of a peer, (robots, hours, numbers); `kind` is "errors" or "tip"."""
    return np.array([[hour[kind] for hour in result[peer]] for result in o.of(peer_hours)])
