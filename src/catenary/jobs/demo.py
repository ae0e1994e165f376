"""The main job in one go, on recordings that the package makes itself: fit every model, test it, write a page."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.evaluate import Evaluation
from catenary.calibration.features import play
from catenary.calibration.files import save_model
from catenary.calibration.fit import FitOptions
from catenary.calibration.progress import Progress, part_of
from catenary.gravity.torque import gravity_torque
from catenary.jobs.calibration import FitRun, evaluate_calibration, fit_calibration
from catenary.jobs.calibration_report import percent, write_calibration_report
from catenary.json_text import json_text
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot

RATE = 30.0  # [Hz] of raven_state as it is recorded
MODELS = {
    "linear": FitOptions(kind="linear"),
    "polynomial": FitOptions(kind="polynomial"),
    "neural, preset paper": FitOptions(kind="neural", preset="paper"),
    "neural, preset best": FitOptions(kind="neural", preset="best"),
}
GRAVITY = np.array([0.0, 0.0, -9.81])
# the box in which the RAVEN-II group calibrates, and the speeds of their random motion (1.1-3 deg/s, ...)
LOWER = np.array([np.deg2rad(20.0), np.deg2rad(55.0), 0.33])
UPPER = np.array([np.deg2rad(60.0), np.deg2rad(110.0), 0.42])
SLOWEST = np.array([np.deg2rad(1.1), np.deg2rad(1.5), 0.0025])
FASTEST = np.array([np.deg2rad(3.0), np.deg2rad(4.0), 0.007])


@dataclass(frozen=True)
class SimulatedCables:
    """Quasi-static cables of three joints: what lies between the motors' and the joints' positions.

    Stiffness, ratio and coupling errors are of the order that reproduces the published errors of a RAVEN-II;
    the registration offsets are the robot's and the encoder rig's own. All assumed, none measured.
    """

    stiffness: Floats  # (3,) [Nm/rad, Nm/rad, N/m]
    ratio_error: Floats  # (3,) true transmission ratio over the nominal one, minus 1
    friction: Floats  # (3,) [Nm, Nm, N]
    slack: Floats  # (3,) half-width within which friction turns round [rad, rad, m]
    run_out: Floats  # (3,) amplitude of the capstans' eccentricity [rad, rad, m]
    registration: Floats  # (3,) robot's zero minus the rig's [rad, rad, m]


def draw_cables(rng: np.random.Generator) -> SimulatedCables:
    """Draw an arm of the kind: every number of the nominal one varied by its own few per cent."""

    def vary(values: list[float], share: float) -> Floats:
        return np.array(values) * (1.0 + share * rng.standard_normal(len(values)))

    return SimulatedCables(
        stiffness=vary([256.0, 491.0, 73.3e3], 0.15),
        ratio_error=np.array([-0.052, -0.056, 0.0]) + 0.01 * rng.standard_normal(3),
        friction=vary([0.25, 0.25, 2.0], 0.2),
        slack=vary([5e-3, 5e-3, 6e-4], 0.2),
        run_out=vary([4.1e-3, 4.7e-3, 2.3e-4], 0.2),
        registration=np.array([0.0, np.deg2rad(7.5), -10.467e-3]),
    )


def random_motion(seconds: float, rng: np.random.Generator) -> Floats:
    """Independent half-cosine moves of each joint between random points of the box, (N, 3) at 30 Hz."""
    rows = round(seconds * RATE)
    columns = []
    for j in range(3):
        q = [rng.uniform(LOWER[j], UPPER[j])]
        path: list[Floats] = []
        while sum(len(part) for part in path) < rows:
            goal = rng.uniform(LOWER[j], UPPER[j])
            duration = max(0.5, abs(goal - q[-1]) / rng.uniform(SLOWEST[j], FASTEST[j]))
            phase = np.linspace(0.0, np.pi, max(2, round(duration * RATE)), endpoint=False)
            path.append(q[-1] + (goal - q[-1]) * 0.5 * (1.0 - np.cos(phase)))
            q.append(goal)
        columns.append(np.concatenate(path)[:rows])
    return np.column_stack(columns)


def simulate_recording(
    name: str, cables: SimulatedCables, seconds: float, rng: np.random.Generator
) -> MotionLog:
    """Record a slow random motion of a simulated RAVEN-II: reported and true joint positions, motor torques.

    Statics only: the cable's stretch is its tension over its stiffness; the tension holds gravity and friction.
    """
    model = load_robot("raven2")
    q_true = random_motion(seconds, rng)
    friction = np.column_stack(
        [
            cables.friction[j] * (q_true[:, j] - play(q_true[:, j].copy(), cables.slack[j])) / cables.slack[j]
            for j in range(3)
        ]
    )
    tension = gravity_torque(model, q_true, GRAVITY) + friction
    stretch = tension / cables.stiffness
    winding = (
        q_true + stretch + cables.run_out * np.sin(q_true * np.array([11.1, 9.9, 176.0]))
    )  # gearbox turns
    q_nominal = winding * (1.0 + cables.ratio_error) + cables.registration
    noise = 0.02 * np.abs(tension).mean(axis=0) * rng.standard_normal(tension.shape)
    time = np.arange(len(q_true)) / RATE
    return MotionLog(
        name=name,
        joint_names=model.joint_names,
        joint_units=model.joint_units,
        q_nominal=q_nominal,
        q_encoder=q_true,
        ok=np.ones(len(q_true), dtype=bool),
        time=time,
        tau=tension + noise,
        robot="raven2",
        simulated=True,
    )


@dataclass(frozen=True)
class DemoResult:
    """What the demo made."""

    page: Path
    model_path: Path
    evaluations: dict[str, Evaluation]

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Header and rows: one row per model, one column per joint."""
        first = next(iter(self.evaluations.values())).joints
        header = ["model", *(f"{joint.name} [{joint.unit}]" for joint in first)]
        rows = [
            ["raw", *(f"{joint.raw_rmse:.3f}" for joint in first)],
            ["fixed offset", *(f"{joint.offset_rmse:.3f} (100 %)" for joint in first)],
        ]
        for name, evaluation in self.evaluations.items():
            rows.append(
                [name, *(f"{j.rmse:.3f} ({percent(j.percent_of_offset, 0)})" for j in evaluation.joints)]
            )
        return header, rows

    def summary(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {
            "simulated": True,
            "page": str(self.page),
            "model": str(self.model_path),
            "models": {
                name: [asdict(joint) for joint in evaluation.joints]
                for name, evaluation in self.evaluations.items()
            },
        }


def run_demo(
    folder: Path,
    *,
    seed: int,
    progress: Progress,
    train_seconds: float = 600.0,
    test_seconds: float = 300.0,
) -> DemoResult:
    """Record a simulated arm twice, fit every model to the first recording, test on the second, write a page.

    Args:
        folder: Where everything goes; made if it is not there.
        seed: Of the arm, its motions and the fits.
        progress: Called with the share done.
        train_seconds: Length of the recording to learn from [s].
        test_seconds: Length of the recording to test on [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    cables = draw_cables(rng)
    train, test = folder / "train.parquet", folder / "test.parquet"
    write_parquet(simulate_recording("train", cables, train_seconds, rng), train)
    write_parquet(simulate_recording("test", cables, test_seconds, rng), test)
    evaluations: dict[str, Evaluation] = {}
    path = folder / "model.npz"
    for i, (name, options) in enumerate(MODELS.items()):
        run = FitRun(folds=0, robot="raven2")
        result = fit_calibration(
            [train], replace(options, seed=seed), run, progress=part_of(progress, i, len(MODELS))
        )
        path = folder / f"{name.replace(', preset ', '_')}.npz"
        save_model(result.model, result.card, path)
        evaluated = evaluate_calibration(path, [test])
        evaluations[name] = evaluated.evaluation
    page = folder / "report.html"
    demo = DemoResult(page, path, evaluations)
    write_calibration_report(
        page,
        evaluated.model,
        evaluated.card,
        evaluated.evaluation,
        tested_on=f"a simulated recording of {test_seconds / 60.0:g} minutes that no model saw",
        comparison=demo.table(),
    )
    (folder / "results.json").write_text(json_text({**demo.summary(), "seed": seed}) + "\n", encoding="utf-8")
    return demo
