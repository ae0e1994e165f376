"""Calibrate a robot in one go, resumable at every step: home, excite, record, extract, fit, evaluate, deploy, page."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from catenary import __version__
from catenary.calibration.evaluate import Evaluation
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_recordings
from catenary.calibration.model_file import load_model, save_model
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.files import card_path, sha256_of
from catenary.parallel import Progress, silent
from catenary.recording.logs import Reading, read_recording
from catenary.reports.project import shown_name, write_project_report
from catenary.trajectories.reference import Trajectory
from catenary.verdict.check import require_apart
from catenary.workflows.calibration_model import held_against, read_to_fit, recordings_for, warnings_of
from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.kinds import project_kind
from catenary.workflows.project.recordings import (
    Imported,
    extract_recording,
    keep_imports,
    motion_log_path,
    read_imports,
)
from catenary.workflows.project.robot import ProjectRobot, SimulatedRobot

TRAIN, TEST = "train", "test"
_VERBS = {f"record {TRAIN}": "excite", f"record {TEST}": "record"}  # by which commands make these recordings
_DEPLOY_S = 20.0
POSITIONING_INPUTS = tuple(f"{group}:{joint}" for group in ("q", "tau") for joint in ("shoulder", "elbow", "insertion"))
RECOMMENDED = "recommended"


def models_for(robot: str | None, options: FitOptions) -> Mapping[str, FitOptions]:
    """Return options of a linear model, and of the one asked for, which is recommended and deployed.

    They share its memory, target and seed, and its inputs where it has any; else a RAVEN-II's models take those of its
    positioning joints. `robot` is a project's, None for recordings.
    """
    if options.inputs is None and robot == "raven2":
        options = replace(options, inputs=POSITIONING_INPUTS)
    return {"linear": options.of_kind("linear"), RECOMMENDED: options.of_kind(options.kind, options.preset)}


@dataclass(frozen=True)
class CalibrationResult:
    """Page, models, errors and deployment of a calibration."""

    page: Path
    model_path: Path
    evaluations: Mapping[str, Evaluation]
    deployment: Mapping[str, Any] | None  # None without a robot
    repeated: tuple[str, ...]  # steps that were run now; the others had been done
    advice: tuple[str, ...]  # warnings of what is recommended, on the test

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


def training_motion(project: Project) -> tuple[Trajectory, Any]:
    """Return the motion that a project's robot is trained on, and its description as plain data."""
    return project_kind(project.settings).excitation()


def evaluation_motion(project: Project, seconds: float, number: int = 0) -> tuple[Trajectory, Any]:
    """Return a random motion of a project's robot, and its description as plain data.

    Args:
        seconds: Duration [s].
        number: Number of the motion, which its seed depends on.
    """
    seed = [0 if project.settings.seed is None else project.settings.seed, 1, number]
    return project_kind(project.settings).random_motion(seconds, seed)


def calibrate_robot(
    project: Project,
    robot: ProjectRobot | None = None,
    *,
    options: FitOptions | None = None,
    run: FitRun | None = None,
    progress: Callable[[str], Progress] = lambda _: silent,
) -> CalibrationResult:
    """Calibrate a project's robot: home, excite, record, extract, fit, evaluate and deploy, skipping finished steps.

    Args:
        robot: Connection to the robot; its simulated one when None.
        options: Model to recommend; the learner when None.
        run: Rows that fits see, and their tests.
        progress: Returns the progress callback of a named step.
    """
    project.ran.clear()
    run = replace(FitRun() if run is None else run, robot=project_kind(project.settings).model)
    models = _models(project, project.settings.robot, options)
    robot = SimulatedRobot() if robot is None else robot
    deployed = project.folder / "deployment.json"

    def deploy() -> None:
        model, _ = load_model(model_path(project, RECOMMENDED))
        motion, _ = evaluation_motion(project, _DEPLOY_S, 1)
        write(deployed, robot.deploy(project, model, motion, after=TEST))

    with project:
        progress("home")
        robot.home(project)
        robot.record(project, TRAIN, *training_motion(project), after="home", progress=progress("excite"))
        tested = evaluation_motion(project, 60.0 * project.settings.test_minutes)
        robot.record(project, TEST, *tested, after=TRAIN, progress=progress("record the test motion"))
        progress("extract")
        for name in (TRAIN, TEST):
            extract_recording(project, name)
        train, test = ([motion_log_path(project, name)] for name in (TRAIN, TEST))
        fit_models(project, train, models, run, progress, Reading())
        progress("deploy")
        made_from = [*map(project.fingerprint_of, (f"fit {RECOMMENDED}", f"record {TEST}")), _DEPLOY_S]
        project.run("deploy", made_from, [deployed], deploy)
        progress("report")
        return conclude(project, models, train, test, deployed, Reading(), run)


def _models(project: Project, robot: str | None, options: FitOptions | None) -> Mapping[str, FitOptions]:
    """Return the options of a project's models, before minutes of motion and fits."""
    options = FitOptions() if options is None else options
    if options.estimator is not None:
        raise InputError("calibrate: fits built-in kinds only; for your own, use catenary fit --model module:Class")
    return models_for(robot, replace(options, seed=project.settings.seed or 0))


def calibrate_recordings(
    project: Project,
    train: Sequence[Path],
    test: Sequence[Path],
    *,
    reading: Reading | None = None,
    options: FitOptions | None = None,
    run: FitRun | None = None,
    progress: Callable[[str], Progress] = lambda _: silent,
) -> CalibrationResult:
    """Calibrate from recordings in place of a robot: judge all, fit every model to some, test it on others.

    Args:
        reading: Mapping and corrections of the recordings.
        options: Model to recommend; the learner when None.
        run: Rows that fits see, and their tests.
        progress: Returns the progress callback of a named step.
    """
    if not train or not test:
        raise InputError("calibrate: give recordings to train on, and others to test on with --test")
    project.ran.clear()
    run = run if run is not None else FitRun()
    models = _models(project, None, options)
    reading = reading if reading is not None else Reading()
    mapping = reading.mapping
    with project:
        imports: list[list[Imported]] = []
        trained_on: Sequence[Any]
        tested_on: Sequence[Any]
        if mapping is not None:
            imports = [read_imports(project, paths, mapping) for paths in (train, test)]
            fitted, tested = ([reading.mend(one.log) for one in logs] for logs in imports)
            reading = Reading(mend=reading.mend)  # logs of ours state all else
            trained_on, tested_on = ([one.path for one in logs] for logs in imports)
        else:
            trained_on, tested_on = _hashes(train), _hashes(test)
            fitted = [read_recording(path, reading) for path in train]
            tested = recordings_for(fitted[0], test, reading)
        both = [str(path) for path, content in zip(test, tested_on, strict=True) if content in trained_on]
        if both:
            raise InputError(f"calibrate: {', '.join(both)}: a recording cannot be both trained and tested on")
        ordered = Recordings.of([*fitted, *tested]).logs  # refuses before minutes of fits
        parts = ordered[: len(fitted)], ordered[len(fitted) :]
        require_apart(*parts, run.accept)
        to_fit, to_test = (Recordings.of(logs, robot=run.robot, max_error=run.max_error) for logs in parts)
        to_fit.judged(run.accept)
        to_test.judged(run.accept, testing=True)
        if imports:
            train, test = (keep_imports(project, logs) for logs in imports)
        fit_models(project, train, models, run, progress, reading, None if imports else to_fit)
        progress("report")
        return conclude(project, models, train, test, None, reading, run)


def model_path(project: Project, name: str) -> Path:
    """Return the path of a project's model."""
    return project.folder / "models" / f"{name}.npz"


def fit_models(
    project: Project,
    train: Sequence[Path],
    models: Mapping[str, FitOptions],
    run: FitRun,
    progress: Callable[[str], Progress],
    reading: Reading,
    resolved: Recordings | None = None,  # what is read of `train`; read when a model is to be fitted if None
) -> None:
    """Fit every model that has not been fitted to these recordings; folds are run for the recommended one."""
    (project.folder / "models").mkdir(exist_ok=True)
    hashes = _hashes(train)

    @cache
    def recordings() -> Recordings:
        if resolved is not None:
            return resolved
        return Recordings.of(read_to_fit(train, reading), robot=run.robot, max_error=run.max_error)

    for name, options in models.items():
        path = model_path(project, name)
        folds = run.folds if name == RECOMMENDED else 0
        of_kind = replace(run, folds=folds)

        def work(options: FitOptions = options, path: Path = path, name: str = name, of_kind: FitRun = of_kind) -> None:
            tell = progress(f"fit {shown_name(name)}")
            result = fit_recordings(recordings(), options, of_kind, progress=tell)
            save_model(result.model, result.card, path)

        made_from = [hashes, asdict(options), asdict(of_kind), asdict(reading)]
        project.run(f"fit {name}", made_from, [path, card_path(path)], work)


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
    reading: Reading,
    run: FitRun,
) -> CalibrationResult:
    """Evaluate every model and write evaluation.json and report.html, unless they hold just this already."""
    held = held_against(model_path(project, RECOMMENDED), test, reading, accept=run.accept, max_error=run.max_error)
    results = {name: held.with_model(model_path(project, name)).evaluate() for name in models}
    deployment = None if deployed is None else json.loads(deployed.read_bytes())
    page = project.folder / "report.html"
    best = results[RECOMMENDED]
    concluded = CalibrationResult(
        page=page,
        model_path=model_path(project, RECOMMENDED),
        evaluations={name: result.evaluation for name, result in results.items()},
        deployment=deployment,
        repeated=tuple(_VERBS.get(step, step) for step in project.ran),
        advice=tuple(warnings_of(best.evaluation)),
    )
    evaluation = project.folder / "evaluation.json"

    def work() -> None:
        write(evaluation, concluded.summary())
        fitted_to, tested_on = recordings_for(best.model, train, reading), held.logs
        write_project_report(
            page, project.settings.connection, best.model, best.card, concluded.evaluations, fitted_to, tested_on,
            deployment, notes=best.notes,
        )  # fmt: skip

    recordings = [[path.name for path in paths] + _hashes(paths) for paths in (train, test)]
    fitted = [sha256_of(model_path(project, name)) for name in models]
    mended: list[Any] = [asdict(reading)]
    mended += [[run.accept, run.max_error]] if run.accept or run.max_error else []
    made_from = [recordings, fitted, deployment, project.settings.connection, __version__, *mended]
    project.run("report", made_from, [evaluation, page], work)
    return concluded
