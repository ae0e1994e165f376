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
from catenary.errors import ConfigError
from catenary.files import card_path, sha256_of
from catenary.recording.bag_reader import open_recordings, rescue_of
from catenary.recording.logs import write_parquet
from catenary.reports.project import shown_name, write_project_report
from catenary.side_by_side import Progress, silent
from catenary.trajectories.reference import Trajectory
from catenary.workflows.calibration_model import held_against, read_to_fit, recordings_for, warnings_of
from catenary.workflows.project.folder import Project, contents, describe, hold, missing, write
from catenary.workflows.project.kinds import kind_of
from catenary.workflows.project.robot import ProjectRobot, SimulatedRobot


def extract_recording(project: Project, name: str) -> bool:
    """Synchronise recordings/NAME into a motion log, NAME.parquet; return whether that had to be done.

    Of a recording that is not whole what is whole is taken; the report, the log's notes and the step say so
    (`rescued`).
    """
    path, report = motion_log_path(project, name), project.folder / f"{name}.synchronised.json"
    recording, step, files = project.folder / "recordings" / name, f"extract {name}", [path, report]
    if missing([recording]) and project.outputs_of(f"record {name}") is None:
        raise ConfigError(f"{project.folder}: record {name} was not done yet")

    below, outputs, changed = f"recordings/{name}", project.outputs_of(f"record {name}"), list[str]()
    made_from = list[str]()
    if outputs is not None:  # motion, and recorded files as their step noted them
        made_from = [project.fingerprint_of(f"record {name}"), contents(outputs, below)]
        noted = {key: one for key, one in outputs.items() if key.startswith(f"{below}/")}
        is_done = project.done(step, [*made_from, *project.settings.columns], files)
        if not is_done and not hold(project.folder, [recording], noted):
            changed = [f"{recording}: is no longer what was recorded; what is there was extracted"]
    if outputs is None or changed:
        made_from = [contents(describe(project.folder, [recording]), below)]
    made_from += project.settings.columns

    def work() -> dict[str, Any]:
        sources = open_recordings([recording])
        result = kind_of(project.settings).synchronise(recording)
        found_whole = rescue_of(sources)
        is_whole = not any(source.damage for source in sources)
        rescued = None if is_whole else found_whole.as_data()
        notes = [] if is_whole else [f"rescued: {found_whole.text()}"]
        write_parquet(replace(result.log, notes=(*result.log.notes, *notes)), path)
        found = {
            "topics": [vars(topic) | {"longest_gap": topic.longest_gap} for topic in result.topics],
            "rows": len(result.log),
            "rows_without_encoder": result.without_encoder,
            "problems": [*notes, *changed, *(problem for source in sources for problem in source.problems)],
            "rescued": rescued,
        }
        write(report, found)
        return {} if rescued is None else {"rescued": rescued}

    return project.run(step, made_from, files, work)


def motion_log_path(project: Project, name: str) -> Path:
    """Return the path of a recording's motion log."""
    return project.folder / f"{name}.parquet"


TRAIN, TEST = "train", "test"
_VERBS = {f"record {TRAIN}": "excite", f"record {TEST}": "record"}  # by which commands make these recordings
_DEPLOY_S = 20.0
POSITIONING_INPUTS = tuple(f"{group}:{joint}" for group in ("q", "tau") for joint in ("shoulder", "elbow", "insertion"))
RECOMMENDED = "recommended"


def models_for(robot: str, asked: FitOptions) -> Mapping[str, FitOptions]:
    """Return options of a linear model, and of the one asked for, which is recommended and deployed.

    They share its memory, target and seed, and its inputs where it has any: else those of a RAVEN-II's positioning
    joints, of a project's `robot` (None for recordings).
    """
    if asked.inputs is None and robot == "raven2":
        asked = replace(asked, inputs=POSITIONING_INPUTS)
    return {"linear": asked.of_kind("linear"), RECOMMENDED: asked.of_kind(asked.kind, asked.preset)}


@dataclass(frozen=True)
class CalibrationResult:
    """Page, models, errors and deployment of a calibration."""

    page: Path
    model_path: Path
    evaluations: Mapping[str, Evaluation]
    deployment: Mapping[str, Any]
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


def excitation(project: Project) -> tuple[Trajectory, Any]:
    """Return the motion that a project's robot is trained on, and its description as plain data."""
    return kind_of(project.settings).excitation()


def random_motion(project: Project, seconds: float, number: int = 0) -> tuple[Trajectory, Any]:
    """Return a random motion of the project's robot, and its description as plain data."""
    seed = [0 if project.settings.seed is None else project.settings.seed, 1, number]
    return kind_of(project.settings).random_motion(seconds, seed)


def calibrate_robot(
    project: Project,
    robot: ProjectRobot | None = None,
    *,
    asked: FitOptions | None = None,
    run: FitRun | None = None,
    progress: Callable[[str], Progress] = lambda _: silent,
) -> CalibrationResult:
    """Calibrate a project's robot, its simulated one when None, doing only what has not been done.

    `asked` is the model to recommend, the learner when None; `run` says which rows fits see, and their tests.
    """
    project.ran.clear()
    run = replace(FitRun() if run is None else run, robot=kind_of(project.settings).model)
    asked = replace(FitOptions() if asked is None else asked, seed=project.settings.seed or 0)
    models = models_for(project.settings.robot, asked)
    robot = SimulatedRobot() if robot is None else robot
    deployed = project.folder / "deployment.json"

    def deploy() -> None:
        model, _ = load_model(model_path(project, RECOMMENDED))
        motion, _ = random_motion(project, _DEPLOY_S, 1)
        write(deployed, robot.deploy(project, model, motion, after=TEST))

    with project:
        progress("home")
        robot.home(project)
        robot.record(project, TRAIN, *excitation(project), after="home", progress=progress("excite"))
        test_motion = random_motion(project, 60.0 * project.settings.test_minutes)
        robot.record(project, TEST, *test_motion, after=TRAIN, progress=progress("record the test motion"))
        progress("extract")
        for name in (TRAIN, TEST):
            extract_recording(project, name)
        train, test = ([motion_log_path(project, name)] for name in (TRAIN, TEST))
        fit_models(project, train, models, run, progress)
        progress("deploy")
        made_from = [*map(project.fingerprint_of, (f"fit {RECOMMENDED}", f"record {TEST}")), _DEPLOY_S]
        project.run("deploy", made_from, [deployed], deploy)
        progress("report")
        return conclude(project, models, train, test, run, deployed)


def model_path(project: Project, name: str) -> Path:
    """Return the path of a project's model."""
    return project.folder / "models" / f"{name}.npz"


def fit_models(
    project: Project,
    train: Sequence[Path],
    models: Mapping[str, FitOptions],
    run: FitRun,
    progress: Callable[[str], Progress],
) -> None:
    """Fit every model that has not been fitted to these recordings; folds are run for the recommended one."""
    (project.folder / "models").mkdir(exist_ok=True)
    hashes = [sha256_of(path) for path in train]

    @cache
    def recordings() -> Recordings:
        return Recordings.of(read_to_fit(train), robot=run.robot, max_error=run.max_error)

    for name, options in models.items():
        path = model_path(project, name)
        folds = run.folds if name == RECOMMENDED else 0
        of_kind = replace(run, folds=folds)

        def work(options: FitOptions = options, path: Path = path, name: str = name, of_kind: FitRun = of_kind) -> None:
            tell = progress(f"fit {shown_name(name)}")
            result = fit_recordings(recordings(), options, of_kind, progress=tell)
            save_model(result.model, result.card, path)

        made_from = [hashes, asdict(options), asdict(of_kind)]
        project.run(f"fit {name}", made_from, [path, card_path(path)], work)


def conclude(
    project: Project,
    models: Mapping[str, FitOptions],
    train: Sequence[Path],
    test: Sequence[Path],
    run: FitRun,
    deployed: Path,
) -> CalibrationResult:
    """Evaluate every model and write evaluation.json and report.html, unless they hold just this already."""
    held = held_against(model_path(project, RECOMMENDED), test, accept=run.accept, max_error=run.max_error)
    results = {name: held.with_model(model_path(project, name)).evaluate() for name in models}
    deployment = json.loads(deployed.read_bytes())
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
        fitted_to, tested_on = recordings_for(best.model, train), held.logs
        write_project_report(
            page, project.settings.connection, best.model, best.card, concluded.evaluations, fitted_to, tested_on,
            deployment, notes=best.notes,
        )  # fmt: skip

    recordings = [[path.name for path in paths] + [sha256_of(path) for path in paths] for paths in (train, test)]
    fitted = [sha256_of(model_path(project, name)) for name in models]
    asked = [run.accept, run.max_error]
    made_from = [recordings, fitted, deployment, project.settings.connection, __version__, *asked]
    project.run("report", made_from, [evaluation, page], work)
    return concluded
