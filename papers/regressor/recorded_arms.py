"""A recording of a real arm, replayed to the on-line estimators: what they would have told, tick by tick."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import GravityEstimator, JointState, RobotModel, load_robot
from catenary.arrays import Floats
from catenary.errors import ExcitationError
from catenary.gravity.estimator import EstimatedGravity, RecursiveGravityEstimator
from catenary.identification.identification import identify_samples
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import Samples, prepare
from catenary.recording.logs import read_torque_log
from catenary.spatial import LEVEL
from papers.experiment import Result, run

# recording: robot, and whether it holds poses at rest
RECORDINGS = {
    "dvrk_mtm_static_gravity/grid4_pos.npz": ("dvrk_mtm", True),
    "dvrk_mtm_static_gravity/grid4_neg.npz": ("dvrk_mtm", True),
    "dvrk_wpi_dynamics/mtm_one.npz": ("dvrk_mtm_motors", False),
    "dvrk_wpi_dynamics/psm_one.npz": ("dvrk_psm_motors", False),
    "dvrk_wpi_dynamics/psm_one_no_weight.npz": ("dvrk_psm_motors", False),
}
LEARNT_SHARE = 0.6  # of a recording, before the part that is held out
OMEGA = 4.0  # [1/s] as for the 19 joints
HELD, TICK = (2.0, 0.05)  # [s] how long a pose is replayed to the law, and how often; least squares hear it once
EVERY = 4  # rows of a motion, 200 Hz, that they hear
NOISE_SHARE = 0.3  # of the torque: what friction and inertia are to an estimator of gravity
FAST = 1e3  # [rad/s] no gate: these motions hardly rest
NO_LIMITS = -1e3  # [rad] margin: recorded limits are the arm's own
POINTS = 300  # of a picture


class Heard(NamedTuple):
    """What an estimator hears of a control loop's tick."""

    time: float
    state: JointState
    tau: Floats


def law(model: RobotModel) -> GravityEstimator:
    """Return the paper's law, as an observer from zero, without a gate of speed."""
    gains = np.ones(model.n)  # an observer takes the torque in place of the PD's
    return GravityEstimator(model, gains, gains, omega=OMEGA, max_speed=FAST)


def least_squares(model: RobotModel, tau: Floats) -> RecursiveGravityEstimator:
    """Return recursive least squares without a gate of speed."""
    noise = np.maximum(NOISE_SHARE * np.sqrt(np.mean(tau**2, axis=0)), 1e-3)
    return RecursiveGravityEstimator(
        model, noise=noise, forgetting=0.999, max_speed=FAST, settle=0.0, interval=0.0, margin=NO_LIMITS
    )


def replayed(estimator: EstimatedGravity, samples: Samples, *, static: bool, until: int) -> tuple[Floats, Floats]:
    """Let an estimator hear a recording, up to a row and then no more.

    Returns:
        What it expects of every row just before it hears it (N, n), and what it expects of every row with what it
        has learnt up to `until` (N, n).
    """
    ahead = np.empty_like(samples.tau)
    learnt = np.empty_like(samples.tau)
    steps = round(HELD / TICK) if static and isinstance(estimator, GravityEstimator) else 1
    for k in range(len(samples)):
        q, qd, tau = samples.q[k], samples.qd[k], samples.tau[k]
        ahead[k] = estimator.torque(q, LEVEL)
        if k < until and (static or k % EVERY == 0):
            for step in range(steps):
                time = k * HELD + step * TICK if static else float(samples.time[k])
                state = JointState(time, q, qd, tau, np.zeros(0), LEVEL, 0.0)
                estimator(Heard(time, state, tau))  # type: ignore[operator]
    for k in range(len(samples)):
        learnt[k] = estimator.torque(samples.q[k], LEVEL)
    return ahead, learnt


def batch(samples: Samples, model: RobotModel, until: int, options: IdentifyOptions) -> Floats | None:
    """Return the torques (N, n) that a batch identification of the first rows predicts; None where it refuses."""
    first = samples.rows(np.arange(len(samples)) < until, samples.name)
    try:
        found = identify_samples([first], model, options)
    except ExcitationError:
        return None
    return found.predict_samples(replace(samples, history=None))


@run(revision=1)
def replay(recording: str, rows: int | None, data: Path) -> Result:
    """Replay a recording; return RMS errors of the part held out by method, and torques over time."""
    name, static = RECORDINGS[recording]
    model = load_robot(name)
    options = IdentifyOptions(terms="static" if static else "full", consistent=False, friction=())
    samples = prepare(read_torque_log(data / recording, model), model, options)
    if rows is not None:
        chosen = np.zeros(len(samples), dtype=bool)
        chosen[np.linspace(0, len(samples) - 1, min(rows, len(samples))).astype(int) if static else slice(rows)] = True
        samples = samples.rows(chosen, samples.name)
    until = round(LEARNT_SHARE * len(samples))
    predicted: dict[str, Floats] = {"none": np.zeros_like(samples.tau)}
    ahead, predicted["law"] = replayed(law(model), samples, static=static, until=until)
    _, predicted["least squares"] = replayed(
        least_squares(model, samples.tau[:until]), samples, static=static, until=until
    )
    gravity = batch(samples, model, until, IdentifyOptions(terms="static", consistent=False))
    if gravity is not None:
        predicted["batch, gravity"] = gravity
    if not static and (whole := batch(samples, model, until, options)) is not None:
        predicted["batch, full dynamics"] = whole
    later = slice(until, None)
    shown = np.linspace(0, len(samples) - 1, min(POINTS, len(samples))).astype(int)
    if static:  # neighbouring poses differ: those about where the held-out part begins
        shown = np.arange(max(0, until - POINTS // 2), min(len(samples), until + POINTS // 2))
    rms = {key: np.sqrt(np.mean((samples.tau - value)[later] ** 2, axis=0)) for key, value in predicted.items()}
    series = {"measured": samples.tau, "law, as it learns": ahead, **predicted}
    return {
        "axes": list(model.joint_names),
        "units": list(model.joint_units),
        "rows": [len(samples), until],
        "rms_Nm_or_N": {key: value.tolist() for key, value in rms.items()},
        "row": shown.tolist(),
        "torque_Nm_or_N": {key: np.round(value[shown], 4).T.tolist() for key, value in series.items()},
    }
