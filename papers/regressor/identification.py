"""Gravity parameters of a simulated RAVEN-II from static poses, and what they are worth to PD+DG.

The robot's own control holds 30 random poses on each of three bases, level and tilted twice, each pose reached once
from below and once from above, so that what friction holds cancels in the mean of the two. Masses are believed to be
20 % too large; the compact parameters are fitted with the believed ones as prior. The gravity torque is compared with
the true one at 30 other poses on a fourth base. The level base's poses go through `identify` (terms static) as well,
whose base parameters need no belief.

Joint positions: "reported" is what the robot gives, from its motors; "calibrated" that after a linear model trained on
the published zig-zag; "true" where the links are. The paper has no such experiment: it is a part of what its method
is for.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from catenary import CablePlant, RobotModel, compact_regressor, gravity_torque, identify, load_robot, record_simulated
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.control.loop import Tick, run_loop
from catenary.control.loop_report import pd_share
from catenary.control.pd import EstimatedGravityPD, JointPD
from catenary.errors import ExcitationError
from catenary.gravity.compact_regressor import CompactRegressor
from catenary.identification.base_parameters import gravity_base_parameters
from catenary.identification.identify_options import IdentifyOptions
from catenary.plant import JointState, MotionLog
from catenary.simulation.base_motion import FixedBase
from catenary.spatial import LEVEL
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.trajectories.zigzag import zigzag
from catenary.workflows.gravity_trials import raven_arm
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.gravity.raven_base import raven_of_2014
from papers.kit import cells, grid, rows, sample, table
from papers.plant.evaluation import linear_model

Positions = Literal["reported", "calibrated", "true"]
TRUE, BELIEF = "true masses", "masses 20 % too large"
POSITIONS: tuple[Positions, ...] = ("reported", "calibrated", "true")
BASES = {
    "level": FixedBase(),
    "tilted": FixedBase(np.deg2rad(20.0), np.deg2rad(15.0)),
    "tilted the other way": FixedBase(np.deg2rad(-15.0), np.deg2rad(20.0)),
}
ON = {"level base": ("level",), "three bases": tuple(BASES)}  # what is fitted to
TEST_BASE = FixedBase(np.deg2rad(10.0), np.deg2rad(-20.0))  # and tested on
LOWER = np.array([np.deg2rad(20.0), np.deg2rad(55.0), 0.33])  # [rad, rad, m] of the published calibration
UPPER = np.array([np.deg2rad(60.0), np.deg2rad(110.0), 0.42])
ASIDE = np.array([np.deg2rad(5.0), np.deg2rad(5.0), 0.01])  # from where a pose is reached
MOVE, REST, SEEN, BLEND = 0.8, 1.2, 0.5, 0.3  # [s] to a pose, at it, of it what counts at its end; rounding
BELIEVED = 1.2  # masses over the true ones
SHOWN = np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0])  # deg, deg, mm
NOISE = np.array([0.15, 0.12, 1.5])  # [Nm, Nm, N] that friction leaves in the mean of both sides, about
SPREAD = 0.3  # [kg m, kg] by how much the believed parameters may be wrong
HELD = "held_error_deg_deg_mm"
AXES = ("J1 [Nm]", "J2 [Nm]", "J3 [N]")
SOURCES = (TRUE, BELIEF, *(f"identified on {on}" for on in ON))
COLORS = ("#b8bfc9", "#8a94a3", "#4b6b94", "#d9622b")


class Poses(NamedTuple):
    """Poses held at rest, means of both sides: K rows."""

    q: dict[Positions, Floats]  # (K, n) in the mechanism's coordinates
    tau: Floats  # (K, n) [Nm|N] that the motors gave
    gravity: Floats  # (3,) [m/s2]
    log: MotionLog  # the same rows, for `identify`


@dataclass(frozen=True)
class Fit:
    """Parameters from one set of poses."""

    on: str
    positions: Positions
    s: Floats  # (p,) compact parameters
    rank: int  # of the poses' regressor


def believed(model: RobotModel) -> RobotModel:
    """Return the robot with every mass wrong by the same factor."""
    return replace(model, tree=model.tree._replace(mass=BELIEVED * model.tree.mass))


def calibration(seed: int | None, sparsities: Sequence[float] = (1 / 2, 1 / 3, 1 / 4)) -> CalibrationModel:
    """Fit a linear model of the joint errors to the published zig-zag on a level base."""
    plant = CablePlant(raven_of_2014(), seed=seed, substeps=1)
    plant.home()
    return linear_model(record_simulated(plant, zigzag("J2-J3", sparsities), "zig-zag", np.random.default_rng(7)))


def hold_poses(base: FixedBase, count: int, seed: int, robot: int | None, model: CalibrationModel | None) -> Poses:
    """Record random poses on a base, each reached from both sides."""
    rng = np.random.default_rng(seed)
    plant = CablePlant(raven_of_2014(), seed=robot, substeps=1, base=base)
    plant.home()
    goals = rng.uniform(LOWER, UPPER, (count, 3))
    stops = np.stack([goals - ASIDE, goals, goals + ASIDE, goals], axis=1).reshape(-1, 3)
    path, ends = _through(stops)
    log = record_simulated(plant, path, "poses", rng)
    assert log.time is not None
    assert log.tau is not None
    assert log.q_encoder is not None
    mechanism = plant.arm.rig.registered - plant.encoders.zero / plant.encoders.rig.counts  # what registration adds
    positions: dict[Positions, Floats] = {"reported": log.q_nominal, "true": log.q_encoder - mechanism}
    if model is not None:
        positions["calibrated"] = model.calibrate(log) - mechanism
    time = log.time - log.time[0]
    held = [(time >= end - SEEN) & (time < end) for end in ends[1::2]]  # second and fourth of each four

    def means(values: Floats) -> Floats:
        sides = np.array([values[rows].mean(axis=0) for rows in held])
        both: Floats = 0.5 * (sides[0::2] + sides[1::2])
        return both

    tau = means(log.tau)
    rows = MotionLog("poses", log.joint_names, log.joint_units, means(log.q_nominal), np.ones(count, bool), tau=tau)
    return Poses({k: means(v) for k, v in positions.items()}, tau, base.sample(np.zeros(1)).gravity[0], rows)


def _through(stops: Floats) -> tuple[SmoothedPath, Floats]:
    """Return a path that rests at each stop, and the time at which each rest ends [s]."""
    times, points = [], []
    for k, stop in enumerate(stops):
        times += [k * (MOVE + REST), k * (MOVE + REST) + REST]
        points += [stop, stop]
    return SmoothedPath.through(times, points, BLEND), np.array(times[1::2])


def fit_compact(regressor: CompactRegressor, s0: Floats, poses: Sequence[Poses], positions: Positions, on: str) -> Fit:
    """Fit compact parameters to the torques by least squares, with the believed parameters as prior."""
    Z = np.concatenate([regressor.Z(p.q[positions], p.gravity) / NOISE[:, None] for p in poses])
    tau = np.concatenate([p.tau / NOISE for p in poses])
    rows, target = Z.reshape(-1, Z.shape[2]), tau.reshape(-1)
    prior = np.eye(len(s0)) / SPREAD
    s = s0 + np.linalg.lstsq(np.vstack([rows, prior]), np.append(target - rows @ s0, 0.0 * s0), rcond=None)[0]
    return Fit(on, positions, s, int(np.linalg.matrix_rank(rows, rtol=1e-6)))


def torque_error(regressor: CompactRegressor, s: Floats, poses: Poses, model: RobotModel, at: Positions) -> Floats:
    """Return the RMS of Z s at given positions minus true gravity at true positions, (n,) [Nm|N]."""
    truth = gravity_torque(model, poses.q["true"], poses.gravity)
    error: Floats = np.sqrt(np.mean((regressor.Z(poses.q[at], poses.gravity) @ s - truth) ** 2, axis=0))
    return error


class KnownGravity:
    """Gravity of parameters that stay as they are."""

    def __init__(self, regressor: CompactRegressor, s: Floats) -> None:
        """Take parameters (p,)."""
        self._kernel, self._s = regressor.kernel(), s

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Return the gravity torque (n,) [Nm|N] at the state."""
        torque: Floats = self._kernel(state.q, state.gravity) @ self._s
        return torque


class Held(NamedTuple):
    """PD+DG at static poses on the test base."""

    share: Floats  # (n,) RMS of the PD term over RMS of the torque
    error: Floats  # (n,) RMS of reference minus reported position [rad|m]


def hold_with(regressor: CompactRegressor, s: Floats, *, count: int, robot: int | None) -> Held:
    """Hold random poses with PD and the gravity of parameters s, sensed gravity, reported positions."""
    plant = CablePlant(raven_of_2014(), seed=robot, base=TEST_BASE)
    plant.home()
    arm = raven_arm(plant)
    goals = np.random.default_rng(99).uniform(LOWER, UPPER, (count, 3))
    path, ends = _through(np.concatenate([arm.plant.measured_js().q[None], np.repeat(goals, 2, axis=0)]))
    kp, kd = arm.gains
    pd = JointPD(kp, kd)
    seen: list[tuple[Floats, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        if tick.tau is not None and ((ends[1:] - SEEN <= tick.time) & (tick.time < ends[1:])).any():
            seen.append((pd.torque(tick.state, tick.reference), tick.tau, tick.reference.q - tick.state.q))

    controller = EstimatedGravityPD(kp, kd, KnownGravity(regressor, s))
    run_loop(arm.plant, controller, path, limits=arm.limits(), observers=[observe])
    feedback, torque, error = (np.sqrt(np.mean(np.square(v), axis=0)) for v in zip(*seen, strict=True))
    return Held(pd_share(feedback, torque), error)


def identified_error(poses: Poses, test: Poses, model: RobotModel) -> Floats | str:
    """Return the RMS error (n,) of `identify` at reported positions of test poses, or why it refuses."""
    x, y, z = (float(g) for g in poses.gravity)
    options = IdentifyOptions(terms="static", consistent=False, gravity=(x, y, z))
    try:
        result = identify([poses.log], model, options)
    except ExcitationError as error:
        return str(error)
    predicted = result.predict(test.q["reported"])
    rms: Floats = np.sqrt(np.mean((predicted - gravity_torque(model, test.q["true"], test.gravity)) ** 2, axis=0))
    return rms


@run(revision=1)
def identified(seed: int | None, poses: int, sparsities: Sequence[float]) -> Result:
    """Identify a robot's gravity parameters, and try them on another base."""
    model = load_robot("raven2")
    regressor = compact_regressor(model)
    s0 = regressor.parameters(believed(model))
    corrected = calibration(seed, sparsities)
    held_on = {name: hold_poses(base, poses, 10 + k, seed, corrected) for k, (name, base) in enumerate(BASES.items())}
    test = hold_poses(TEST_BASE, poses, 50, seed, corrected)
    level_test = hold_poses(BASES["level"], poses, 51, seed, corrected)
    fits: dict[str, Fit] = {}
    errors: dict[str, list[float]] = {}
    held: dict[str, Held] = {}
    tried = max(1, poses // 3)
    for name, s in ((TRUE, regressor.parameters()), (BELIEF, s0)):
        for at in POSITIONS:
            errors[f"{name}, {at}"] = torque_error(regressor, s, test, model, at).tolist()
        held[name] = hold_with(regressor, s, count=tried, robot=seed)
    for on, names in ON.items():
        for at in POSITIONS:
            fit = fit_compact(regressor, s0, [held_on[name] for name in names], at, on)
            label = f"identified on {on}, {at}"
            fits[label] = fit
            errors[label] = torque_error(regressor, fit.s, test, model, at).tolist()
            if at == "reported":
                held[f"identified on {on}"] = hold_with(regressor, fit.s, count=tried, robot=seed)
    refused = identified_error(held_on["level"], level_test, model)
    return {
        "base_parameters": {
            "level base": gravity_base_parameters(model, LEVEL).count,
            "three bases": gravity_base_parameters(model, None).count,
        },
        "ranks": {label: fit.rank for label, fit in fits.items()},
        "error_Nm_Nm_N": errors,
        "pd_share_percent": {label: (100.0 * one.share).tolist() for label, one in held.items()},
        "held_error_deg_deg_mm": {label: (SHOWN * one.error).tolist() for label, one in held.items()},
        "identify_Nm_Nm_N": refused if isinstance(refused, str) else refused.tolist(),
    }


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot."""
    poses, sparsities = (2, (1 / 2,)) if scope.quick else (30, (1 / 2, 1 / 3, 1 / 4))
    return grid(identified, {"seed": scope.robots}, poses=poses, sparsities=sparsities)


def error_with(o: Outcomes, source: str, at: str) -> Floats:
    """Return the RMS error of the gravity torque on another base (robots, 3) [Nm, Nm, N]."""
    return sample(o, identified, "error_Nm_Nm_N", f"{source}, {at}")


def report(o: Outcomes) -> Report:
    """Return torque errors on another base, what poses tell, and PD+DG with what was found."""
    results = o.of(identified)
    counts = results[0]["base_parameters"]
    ranks = [
        [
            label,
            ", ".join(sorted({str(one["ranks"][label]) for one in results})),
            str(counts[label.removeprefix("identified on ").split(",")[0]]),
        ]
        for label in results[0]["ranks"]
    ]

    def held(source: str) -> list[str]:
        shares, errors = (sample(o, identified, what, source) for what in ("pd_share_percent", HELD))
        return [source, *cells(shares, 0), *cells(errors)]

    def off(source: str, at: str) -> list[str]:
        return [source, at, *cells(error_with(o, source, at))]

    tables = [
        table(
            "Gravity torque at poses on another base, RMS error",
            ["parameters", "positions", *AXES],
            rows(off, SOURCES, POSITIONS),
        ),
        table("What the poses tell", "fit | rank | base parameters", ranks),
        table(
            "PD+DG at static poses on that base, reported positions",
            ["parameters", *(f"PD share J{j} [%]" for j in (1, 2, 3)), "error J1 [deg]", "J2 [deg]", "J3 [mm]"],
            rows(held, SOURCES),
        ),
    ]
    outcomes = [one["identify_Nm_Nm_N"] for one in results]
    remarks = [each for each in outcomes if isinstance(each, str)]
    if measured := [each for each in outcomes if not isinstance(each, str)]:
        words = ", ".join(f"{axis} {value}" for axis, value in zip(AXES, cells(np.array(measured)), strict=True))
        remarks.append(
            "`identify` (terms static) of the level base's poses with reported positions, at other poses there, RMS "
            f"error: {words}."
        )
    caption = "RMS error of the gravity torque on another base, by positions"
    return Report(tables, {caption: _picture(o)}, remarks)


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.0)
    places = np.arange(len(POSITIONS))
    for j, panel in enumerate(axes):
        for k, source in enumerate(SOURCES):
            values = [error_with(o, source, at)[:, j].mean() for at in POSITIONS]
            panel.bar(places + (k - 1.5) * 0.2, values, 0.18, color=COLORS[k], label=source)
        panel.set_xticks(places, POSITIONS, fontsize=8)
        panel.set_title(AXES[j], fontsize=10)
    legend_below(figure, axes[0], columns=4)
    return figure


EXPERIMENT = Experiment(
    "regressor-identification", "beyond the paper",
    "Gravity parameters of a RAVEN-II from poses that it holds", __doc__,
    cases, report, minutes=13.0,
)  # fmt: skip
