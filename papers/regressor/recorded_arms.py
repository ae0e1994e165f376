"""The on-line law on recorded motions of real arms: a replay, beyond the gravity-regressor paper's simulation.

Recordings of a dVRK's master (MTM) and slave (PSM): 4,096 poses of the master that it holds at rest, each approached
from one side (Lin et al.), and Fourier motions of both (Wang et al.). The estimators hear positions, velocities and
torques as observers beside a controller; the law from zero, Omega 4 / s, on the compact regressor; recursive least
squares beside it. They learn from the first 60 % and are then asked for the rest, in the order of the recording; a
batch identification of the same rows stands beside them (gravity with constants, friction's offsets and springs; full
dynamics on motions). "None" is the torque itself.

The paper's law is for arms at rest. The Fourier motions never rest: there the law runs without its gate of speed, and
takes friction and inertia for gravity. Poses are replayed to the law for 2 s each, to the least squares once; these
take 30 % of the torque for noise.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

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
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.kit import Missing, by_count, grid, table

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
METHODS = ("none", "law", "least squares", "batch, gravity", "batch, full dynamics")
STATIC = tuple(name for name, (_, static) in RECORDINGS.items() if static)
MOVING = tuple(name for name, (_, static) in RECORDINGS.items() if not static)
LOADED_AXES = (1, 2)  # J2, J3 of the master: those that gravity loads most
SHOWN = {STATIC[0]: (1, 2), MOVING[1]: (0, 1)}  # axes of pictures
COLORS = {"measured": "#b8bfc9", "law, as it learns": "#d9622b", "least squares": "#4b6b94"}
LABELS = {"least squares": "least squares, as learnt in the end"}
HALF = 0.5


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
    """Return what an estimator that learns until a row expects of every row: just before it, and in the end, (N, n)."""
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
        identified = identify_samples([first], model, options)
    except ExcitationError:
        return None
    return identified.predict_samples(replace(samples, history=None))


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


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every recording that is there."""
    names = [] if scope.data is None else [name for name in RECORDINGS if (scope.data / name).is_file()]
    return grid(replay, {"recording": names[:1] if scope.quick else names}, rows=200 if scope.quick else None)


def of(o: Outcomes, recording: str) -> Result:
    """Return what a recording showed."""
    for result in o.of(replay, recording=recording):
        return result
    raise Missing(recording)


def report(o: Outcomes) -> Report:
    """Return errors of the later part by recording and method, and torques over time."""
    tables, pictures, remarks = [], {}, []
    for recording in RECORDINGS:
        try:
            result = of(o, recording)
        except Missing:
            remarks.append(f"{recording}: no such recording here.")
            continue
        name, rms, (whole, until) = recording.removesuffix(".npz"), result["rms_Nm_or_N"], result["rows"]
        header = ["predicted by", *(_axis(result, k) for k in range(len(result["axes"])))]
        content = [[method, *(f"{value:.3f}" for value in rms[method])] for method in METHODS if method in rms]
        tables.append(table(f"{name}: RMS error on rows {until} to {whole}, none of them learnt from", header, content))
        if recording in SHOWN:
            caption = f"{name}: measured and predicted torque; shaded: learnt from"
            pictures[caption] = _picture(result, SHOWN[recording])
    return Report(tables, pictures, remarks)


def _axis(result: Result, k: int) -> str:
    return f"{result['axes'][k]} [{'Nm' if result['units'][k] == 'rad' else 'N'}]"


def _picture(result: Result, axes_shown: Sequence[int]) -> Any:
    figure, axes = panels(1, 2.3 * len(axes_shown), rows=len(axes_shown), sharex=True)
    for panel, k in zip(axes, axes_shown, strict=True):
        panel.axvspan(result["row"][0], result["rows"][1], color="#eef1f5", zorder=0)
        for name, color in COLORS.items():
            torque = result["torque_Nm_or_N"][name][k]
            width = 3.0 if name == "measured" else 1.1
            label = LABELS.get(name, name)
            panel.plot(result["row"], torque, color=color, linewidth=width, label=label)
        panel.set_ylabel(_axis(result, k))
        measured = np.array(result["torque_Nm_or_N"]["measured"][k])
        low, high = float(measured.min()), float(measured.max())
        panel.set_ylim(low - 0.4 * (high - low), high + 0.4 * (high - low))
    axes[-1].set_xlabel("row")
    legend_below(figure, axes[0], columns=3)
    return figure


def _left(o: Outcomes, recordings: Sequence[str], axes: Sequence[int]) -> tuple[list[float], str]:
    """Return which share of the torque the law leaves on axes of the later part, and the same in words."""
    shares: dict[str, float] = {}
    for recording in recordings:
        result, short = of(o, recording), recording.partition("/")[2].removesuffix(".npz")
        rms = result["rms_Nm_or_N"]
        shares |= {f"{short} {result['axes'][k]}": rms["law"][k] / rms["none"][k] for k in axes}
    return list(shares.values()), f"left: {', '.join(f'{name} {100.0 * each:.0f} %' for name, each in shares.items())}"


EXPERIMENT = Experiment(
    "regressor-replay", "beyond the paper", "The on-line law on recorded motions", __doc__,
    cases, report, minutes=1.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip


@EXPERIMENT.claim(
    "On a real arm, too, the parameters give the gravitational force once they are estimated",
    "IV, future work",
    "to be implemented in the real robot, no numbers",
    "on poses at rest of a master arm that come later, the law leaves less than half of the torque on the axes that "
    "gravity loads, J2 and J3, in both recordings",
    "The law fits the pose at hand, by the smallest change of parameters, and lets go of what other poses told; how "
    "well it does in others is left to where it stood last. Least squares on the same rows, which add the poses up, "
    "leave far less in both recordings (tables); so the parameters are there to be found.",
)
def _at_rest(o: Outcomes) -> Judgement:
    shares, text = _left(o, STATIC, LOADED_AXES)
    return by_count([share < HALF for share in shares], text)
