"""Calibrate a robot in one go, resumable at every step: home, excite, record, extract, fit, evaluate, deploy, page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from catenary import __version__
from catenary.calibration.choice import JointChoice
from catenary.calibration.dataset import require_same_joints
from catenary.calibration.evaluate import Evaluation
from catenary.calibration.files import load_model, save_model
from catenary.calibration.fit import FitOptions
from catenary.calibration.fitting import FitRun
from catenary.calibration.progress import Progress, silent
from catenary.errors import InputError
from catenary.files import card_path, sha256_of
from catenary.recording.foreign.read import Reading, read_logs
from catenary.reports.calibration import percent
from catenary.reports.project import write_project_report
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import zigzag
from catenary.verdict.shared import require_apart
from catenary.workflows.fit import evaluate_calibration, fit_calibration, warnings_of
from catenary.workflows.model_recordings import recordings_for
from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.imported import import_recordings
from catenary.workflows.project.recordings import extract_recording, motion_log_path
from catenary.workflows.project.robot import ProjectRobot
from catenary.workflows.project.simulated_robot import SimulatedRobot
from catenary.workflows.project.state import DeploymentFile, read_state

TRAIN, TEST = "train", "test"
VERBS = {f"record {TRAIN}": "excite", f"record {TEST}": "record"}  # by which commands make these recordings
DEPLOY_SECONDS = 20.0
POSITIONING_INPUTS = tuple(
    f"{group}:{joint}" for group in ("q", "tau") for joint in ("shoulder", "elbow", "insertion")
)
# the tool's torques tell the insertion's cable where it lies; its positions only repeat the insertion motor's
RAVEN_INPUTS = {
    "shoulder": POSITIONING_INPUTS,
    "elbow": POSITIONING_INPUTS,
    "insertion": (*POSITIONING_INPUTS, "tau:roll", "tau:wrist", "tau:jaw1", "tau:jaw2"),
}
RECOMMENDED = "recommended"


def models_for(robot: str | None, seed: int) -> Mapping[str, FitOptions]:
    """Return options for every kind of model, and of what is chosen among them joint by joint, which is deployed.

    The paper's network has all of the paper's inputs.
    """
    everything = ("q", "tau") if robot is not None else None
    positioning = POSITIONING_INPUTS if robot is not None else None
    inputs = RAVEN_INPUTS if robot is not None else None
    return {
        "linear": FitOptions(kind="linear", inputs=positioning, seed=seed),
        "polynomial": FitOptions(kind="polynomial", inputs=positioning, seed=seed),
        "neural_paper": FitOptions(kind="neural", preset="paper", inputs=everything, seed=seed),
        "neural_best": FitOptions(kind="neural", preset="best", inputs=inputs, seed=seed),
        RECOMMENDED: FitOptions(kind="auto", inputs=inputs, seed=seed),
    }


@dataclass(frozen=True)
class CalibrationResult:
    """Page, models, errors and deployment of a calibration."""

    page: Path
    model_path: Path
    evaluations: Mapping[str, Evaluation]
    deployment: Mapping[str, Any] | None  # None without a robot
    repeated: tuple[str, ...]  # steps that were run now; the others had been done
    advice: tuple[str, ...]  # what is recommended for each joint and why, and warnings of it on the test

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Return header and rows: one row per model, one column per joint."""
        first = next(iter(self.evaluations.values())).joints
        header = ["model", *(f"{joint.name} [{joint.unit}]" for joint in first)]
        rows = [
            ["raw", *(f"{joint.raw_rmse:.3f}" for joint in first)],
            ["fixed offset", *(f"{joint.offset_rmse:.3f} (100 %)" for joint in first)],
        ]
        for name, evaluation in self.evaluations.items():
            cells = (f"{j.rmse:.3f} ({percent(j.percent_of_offset, 0)})" for j in evaluation.joints)
            rows.append([name.replace("_", ", preset "), *cells])
        return header, rows

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "page": str(self.page),
            "model": str(self.model_path),
            "steps_run": list(self.repeated),
            "advice": list(self.advice),
            "models": {name: [asdict(j) for j in e.joints] for name, e in self.evaluations.items()},
            "deployment": self.deployment,
        }


def excitation(project: Project) -> tuple[Trajectory, Any]:
    """Return the project's zig-zag motion, and its description as plain data."""
    settings = project.settings
    motion = {"zigzag": settings.direction, "sparsities": settings.sparsities}
    # projects without a form were driven along other paths, but for these two: again
    if settings.direction not in ("J1", "J1-J2"):
        motion["form"] = settings.form
    path = zigzag(settings.direction, settings.sparsities, form=settings.form)  # type: ignore[arg-type]  # others refused
    return path, motion


def random_motion(project: Project, seconds: float, number: int = 0) -> tuple[Trajectory, Any]:
    """Return a random motion of the project's robot, and its description as plain data."""
    seed = [0 if project.settings.seed is None else project.settings.seed, 1, number]
    return random_sinusoids(np.random.default_rng(seed), seconds), {"random": seconds, "rng": seed}


def calibrate_robot(
    project: Project,
    robot: ProjectRobot | None = None,
    *,
    progress: Callable[[str], Progress] = lambda _: silent,
) -> CalibrationResult:
    """Calibrate a project's robot, doing only what has not been done.

    Args:
        project: Folder and settings.
        robot: Homes, moves, records; the project's simulated one when None.
        progress: Given a step's name, returns a callback for the share done.

    Raises:
        CatenaryError: A step failed; what was done before stays, and is not done again.
    """
    project.ran.clear()
    with project:
        return _calibrated(project, SimulatedRobot() if robot is None else robot, progress)


def _calibrated(
    project: Project, robot: ProjectRobot, progress: Callable[[str], Progress]
) -> CalibrationResult:
    progress("home")
    robot.home(project)
    robot.record(project, TRAIN, *excitation(project), after="home", progress=progress("excite"))
    test_motion = random_motion(project, 60.0 * project.settings.test_minutes)
    robot.record(project, TEST, *test_motion, after=TRAIN, progress=progress("record the test motion"))
    progress("extract")
    for name in (TRAIN, TEST):
        extract_recording(project, name)
    seed = 0 if project.settings.seed is None else project.settings.seed
    train, test = ([motion_log_path(project, name)] for name in (TRAIN, TEST))
    models = models_for(project.settings.robot, seed)
    fit_models(project, train, models, FitRun(robot=project.settings.robot), progress)

    deployed = project.folder / "deployment.json"

    def deploy() -> None:
        model, _ = load_model(model_path(project, RECOMMENDED))
        motion, _ = random_motion(project, DEPLOY_SECONDS, 1)
        write(deployed, robot.deploy(project, model, motion, after=TEST))

    progress("deploy")
    made_from = [*map(project.fingerprint_of, (f"fit {RECOMMENDED}", f"record {TEST}")), DEPLOY_SECONDS]
    project.run("deploy", made_from, [deployed], deploy)
    progress("report")
    return conclude(project, models, train, test, deployed)


def calibrate_recordings(
    project: Project,
    train: Sequence[Path],
    test: Sequence[Path],
    *,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
    progress: Callable[[str], Progress] = lambda _: silent,
) -> CalibrationResult:
    """Calibrate from recordings in place of a robot: fit every model to some, test on others.

    Raises:
        DataError: Something is wrong with a recording that `accept` does not name, or rows are in both.
        InputError: No recording to train on or to test on, or one that is in both.
    """
    if not train or not test:
        raise InputError("calibrate: give recordings to train on, and others to test on with --test")
    project.ran.clear()
    models = models_for(None, 0)
    reading = reading if reading is not None else Reading()
    mapping = reading.mapping
    with project:
        if mapping is not None:
            train, test = (import_recordings(project, paths, mapping) for paths in (train, test))
            reading = Reading(mend=reading.mend)  # logs of ours state all else
        _refuse_same(train, test)
        first, *others = fitted = read_logs(train, reading)
        tested = recordings_for(first, test, reading)
        for other in (*others, *tested):  # before minutes of fits
            require_same_joints(first, other)
        require_apart(fitted, tested, accept)
        fit_models(project, train, models, FitRun(accept=accept), progress, reading)
        progress("report")
        return conclude(project, models, train, test, None, reading=reading, accept=accept)


def _refuse_same(train: Sequence[Path], test: Sequence[Path]) -> None:
    hashes = _hashes(train)
    both = [str(path) for path, content in zip(test, _hashes(test), strict=True) if content in hashes]
    if both:
        raise InputError(f"calibrate: {', '.join(both)}: a recording cannot be both trained and tested on")


def model_path(project: Project, name: str) -> Path:
    """Return the path of a project's model."""
    return project.folder / "models" / f"{name}.npz"


def fit_models(
    project: Project,
    train: Sequence[Path],
    models: Mapping[str, FitOptions],
    run: FitRun,
    progress: Callable[[str], Progress],
    reading: Reading | None = None,
) -> None:
    """Fit every model that has not been fitted to these recordings; folds are run where a model is chosen by them."""
    (project.folder / "models").mkdir(exist_ok=True)
    hashes = _hashes(train)
    reading = reading if reading is not None else Reading()
    for name, options in models.items():
        path = model_path(project, name)
        folds = run.folds if options.kind == "auto" else 0
        of_kind = replace(run, folds=folds)

        def work(
            options: FitOptions = options, path: Path = path, name: str = name, of_kind: FitRun = of_kind
        ) -> None:
            tell = progress(f"fit {name.replace('_', ', preset ')}")
            result = fit_calibration(list(train), options, of_kind, reading=reading, progress=tell)
            save_model(result.model, result.card, path)

        made_from = [hashes, asdict(options), asdict(of_kind), asdict(reading)]
        project.run(f"fit {name}", made_from, [path, card_path(path)], work)


def _inputs_of(results: Mapping[str, Any]) -> dict[str, list[int]]:
    """Return how many features the models take for each joint, by their names in the table."""
    counts = {}
    for name, result in results.items():
        of_joint = {joint: len(group.columns) for group in result.model.groups for joint in group.joints}
        counts[name.replace("_", ", preset ")] = [of_joint[joint] for joint in sorted(of_joint)]
    return counts


def _hashes(paths: Sequence[Path]) -> list[str]:
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: no such recording")
    return [sha256_of(path) for path in paths]


def conclude(
    project: Project,
    models: Mapping[str, FitOptions],
    train: Sequence[Path],
    test: Sequence[Path],
    deployed: Path | None,
    *,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
) -> CalibrationResult:
    """Evaluate every model and write evaluation.json and report.html, unless they hold just this already."""
    results = {
        name: evaluate_calibration(model_path(project, name), list(test), reading=reading, accept=accept)
        for name in models
    }
    deployment = None
    if deployed is not None:
        deployment = read_state(
            deployed, DeploymentFile, "delete it, and `catenary calibrate PROJECT` makes it again"
        )
    page = project.folder / "report.html"
    best = results[RECOMMENDED]
    concluded = CalibrationResult(
        page=page,
        model_path=model_path(project, RECOMMENDED),
        evaluations={name: result.evaluation for name, result in results.items()},
        deployment=deployment,
        repeated=tuple(VERBS.get(step, step) for step in project.ran),
        advice=(
            *(str(JointChoice(**choice)) for choice in best.card.get("choice") or ()),
            *warnings_of(best.evaluation),
        ),
    )
    evaluation = project.folder / "evaluation.json"

    def work() -> None:
        write(evaluation, concluded.summary())
        write_project_report(
            page, project.settings.connection, best.model, best.card, best.evaluation, concluded.table(),
            train, test, deployment, notes=best.notes, inputs=_inputs_of(results),
        )  # fmt: skip

    recordings = [[path.name for path in paths] + _hashes(paths) for paths in (train, test)]
    fitted = [sha256_of(model_path(project, name)) for name in models]
    mended = [] if reading is None and not accept else [None if reading is None else asdict(reading), accept]
    made_from = [recordings, fitted, deployment, project.settings.connection, __version__, *mended]
    project.run("report", made_from, [evaluation, page], work)
    return concluded
