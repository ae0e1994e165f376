"""catenary fit, evaluate, refresh, drift: fit, test and update a calibration model, and track its error over days."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.calibration.model_kinds import LEARNED, MODEL_KINDS
from catenary.cli.exit_codes import FAULT_FOUND
from catenary.cli.options import (
    REPORT,
    REQUIRED,
    Names,
    Numbers,
    argument,
    group,
    numbers,
    option,
    prints_tables,
    values_of,
    words,
)
from catenary.cli.out_files import MODEL, NAMED_AS_TYPED, PARAMETERS
from catenary.cli.recording_options import (
    ACCEPT,
    MAX_ERROR,
    OWN_CLASS,
    RECORDINGS,
    ModelRecordingOptions,
    RecordingOptions,
)
from catenary.cli.terminal import print_page, print_result, progress_bar
from catenary.errors import InputError
from catenary.files import card_path
from catenary.parallel import on_workers
from catenary.reports.page import Block, Heading, picture
from catenary.tables import Column, Table

if TYPE_CHECKING:
    from catenary.calibration.fit_options import FitOptions, FitRun
    from catenary.calibration.fit_recordings import FitResult
    from catenary.workflows.calibration_model import HeldAgainst

_MAX_SEED = 2**32 - 1  # that scikit-learn takes
ROBOT_OF_DATA = option("ROBOT", "Catalogue name or file of the robot: joint names and units.")


def _play_shares(text: str) -> Numbers:
    if text == "on":
        from catenary.calibration.fit_options import PLAY_SHARES

        return PLAY_SHARES
    return () if text == "off" else numbers(text)


def _inputs(text: str) -> Names | dict[str, Names]:
    if "=" not in text:
        return words(text)
    per_joint = {}
    for part in text.split(";"):
        joint, equals, chosen = part.partition("=")
        if not equals or not words(chosen):
            raise typer.BadParameter(f"expected 'JOINT=signal,signal;JOINT=...', got {part!r}")
        per_joint[joint.strip()] = words(chosen)
    return per_joint


@group
class ModelOptions:
    """Options of a fit, by the names of FitOptions and FitRun, which refuse what they do not know."""

    kind: str = option("KIND", f"{'; '.join(map(str, MODEL_KINDS.values()))}.", LEARNED, flag="--model")
    preset: str | None = option("NAME", "Preset of a neural model: paper (Peng et al.).")
    inputs: Names | dict[str, Names] | None = option(
        "SIGNALS", "Inputs: q, tau, qd, all, q:J1; or 'J1=q:J1;J2=q'. [default: q, and tau if recorded]", read=_inputs
    )
    play: Numbers | None = option(
        "SHARES|on|off", "Also use play states; half-widths as shares of each joint's motion.", read=_play_shares
    )
    target: str = option("error|position", "Learn the joint error, or the joint position end to end.", "error")
    coupled: Names | None = option(
        "JOINTS|off",
        "Joints that friction couples, such as J5,J6. [default: found in the recordings]",
        read=lambda text: () if text == "off" else words(text),
    )
    ridge: float | None = option("R", "Weight on the squared coefficients. [default: by the model's kind]", min=0.0)
    held_out: float | None = option("SHARE", "Keep the last part of each recording, this share of it, for a test.")
    folds: int = option("N", "Blocks of the cross-validation; 0 for none.", 5, min=0)
    coverage: float = option("SHARE", "Share of errors that the intervals hold.", 0.9)
    max_error: Numbers | None = MAX_ERROR
    instrument: str | None = option("NAME", "For the card: the arm's instrument, e.g. its serial number.")
    tool: str | None = option("NAME", "For the card: the kind of tool, e.g. large-needle-driver.")
    date: str | None = option("DAY", "For the card: day of recordings without dated stamps, e.g. 2026-05-14.")

    def options(self, seed: int) -> "FitOptions":
        """Return the options of the model, its training by this seed."""
        from catenary.calibration.fit_options import FitOptions
        from catenary.calibration.own_model import chosen

        names = ("preset", "inputs", "play", "target", "ridge", "coupled")
        kind, estimator = chosen(self.kind)
        return FitOptions(kind, seed=seed, estimator=estimator, **values_of(self, *names))

    def run(self, accept: Sequence[str], robot: str | None = None) -> "FitRun":
        """Return the options that do not belong to the model."""
        from catenary.calibration.fit_options import FitRun

        return FitRun(
            robot=robot,
            accept=tuple(accept),
            **values_of(self, "max_error", "held_out", "folds", "coverage", "instrument", "tool", "date"),
        )


@prints_tables
def fit(
    fitting: ModelOptions,
    recordings: RecordingOptions,
    data: Sequence[Path] = RECORDINGS,
    out: Path = option("MODEL", f"Model to write, e.g. arm.npz. {NAMED_AS_TYPED}", REQUIRED, writes=MODEL),
    robot: str | None = ROBOT_OF_DATA,
    seed: int = option("N", "Seed of all randomness.", 0, min=0, max=_MAX_SEED),
    accept: Sequence[str] = ACCEPT,
    workers: int = option("N", "Processes that read and fit side by side.", 1, min=1),
    cluster: str | None = option("ADDRESS", "Dask scheduler to use instead, e.g. tcp://HOST:8786."),
    report: Path | None = REPORT,
) -> None:
    """Fit a calibration model; print its error on other data.

    Example: catenary fit run1.npz --out arm.npz
    """
    from catenary.calibration.model_file import save_model
    from catenary.workflows.calibration_model import fit_calibration

    options = fitting.options(seed)
    arm = None if robot is None else catenary.load_robot(robot)
    reading, run = recordings.reading(robot), fitting.run(accept, robot)
    with progress_bar(f"fitting {fitting.kind}") as progress, on_workers(workers, cluster):
        result = fit_calibration(data, options, run, reading=reading, progress=progress)
    save_model(result.model, result.card, out)
    _print_fit(out, result)
    if report is not None:  # last: whatever goes wrong with it, the model is there
        _write_fit_report(report, result, arm)
        print_page(report)


@group
class HeldModel(ModelRecordingOptions):
    """A model, and recordings that it is held against."""

    model: Path = argument("MODEL", "A model that catenary fit or refresh wrote; for drift also of identify.")
    data: Sequence[Path] = RECORDINGS
    max_error: Numbers | None = MAX_ERROR
    accept: Sequence[str] = ACCEPT
    report: Path | None = REPORT
    own: str | None = OWN_CLASS

    def against(self) -> "HeldAgainst":
        """Read both."""
        from catenary.workflows.calibration_model import held_against

        return held_against(
            self.model, self.data, self.reading(), accept=self.accept, max_error=self.max_error, own=self.own
        )


@prints_tables
def evaluate(
    held: HeldModel,
    window: float | None = option("S", "Length of a time window in s. [default: a tenth of the data]"),
    robot: str | None = option(
        "ROBOT", "Catalogue name or file of the robot: with --report, the error of its tip. [default: the model's]"
    ),
) -> None:
    """Print a model's error on recordings, before and after.

    RMSE and maximum per joint in deg and mm, RMSE per window of time, share of errors within the intervals.

    Example: catenary evaluate arm.npz run2.npz --report run2.html
    """
    from catenary.calibration.evaluate import error_table
    from catenary.reports.calibration import write_calibration_report
    from catenary.reports.joint_errors import coverage_table, window_table

    arm = None if robot is None else catenary.load_robot(robot)
    result = held.against().evaluate(window)
    judged = result.evaluation
    tables = error_table(judged), coverage_table(judged), window_table(judged)
    print_result(result.as_data(), *tables, notes=result.notes)
    if held.report is not None:
        tested_on = ", ".join(source.name for source in result.evaluation.data.sources)
        if result.seen_in_training:
            tested_on += f" (no test: the model was fitted to {', '.join(result.seen_in_training)})"
        write_calibration_report(
            held.report, result.model, result.card, result.evaluation, tested_on=tested_on, notes=result.notes,
            unseen=not result.seen_in_training, robot=arm,
        )  # fmt: skip
        print_page(held.report)


@prints_tables
def refresh(
    held: HeldModel, out: Path = option("MODEL", f"Refreshed model to write. {NAMED_AS_TYPED}", REQUIRED, writes=MODEL)
) -> None:
    """Update a model with minutes of a new day.

    If the model has friction states, their level is updated first. Then each joint gets the smallest change that
    cross-validation on the new data supports: nothing, or zero and scale. The card
    states the original model, what changed, and since when.
    `catenary excite --refresh` drives a motion that shows enough.

    Example: catenary refresh arm.npz today.parquet --out arm_today.npz
    """
    from catenary.calibration.model_file import save_model
    from catenary.reports.drift import PROMISE, refresh_table, write_refresh_report

    result = held.against().refresh()
    save_model(result.model, result.card, out)
    content = {"model": str(out), "card": str(card_path(out)), **result.as_data()}
    table = refresh_table(result.refreshed.changes, len(result.data))
    files = f"{PROMISE}\nmoved: {result.moved}\nmodel: {out}\ncard:  {card_path(out)}"
    print_result(content, table, files, notes=result.notes)
    if held.report is not None:
        write_refresh_report(
            held.report, result.refreshed, result.data, model=held.model.name, moved=result.moved, notes=result.notes
        )
        print_page(held.report)


@prints_tables
def drift(
    held: HeldModel,
    factor: float = option("K", "For a model without intervals: multiple of its card's error that is drift.", 2.0),
) -> None:
    """Print errors over days, of a model or of cards.

    Give a model and recordings in chronological order: errors from homing to homing. Or give several models or their
    .card.json: errors, delays and zeros by date. The exit code is 1 if a joint's errors at the end are beyond what the
    model promises, or if a recording has a fault other than drift.

    Of parameters that catenary identify wrote it prints zeros, gains, loads and friction that differ in recordings.

    Example: catenary drift arm.npz monday.parquet tuesday.parquet --report drift.html
    """
    if held.model.is_file() and PARAMETERS.is_one(held.model):
        _arm_drift(held)
        return
    from catenary.calibration.model_drift import since_in_words
    from catenary.reports.drift import drift_tables, write_drift_report
    from catenary.workflows.calibration_model import card_history, drift_summary

    if all(path.suffix == ".json" or (path.is_file() and MODEL.is_one(path)) for path in held.data):
        if held != HeldModel(**values_of(held, "model", "data", "report")):
            raise InputError("drift: options of recordings do not go with models and cards")
        result, notes = card_history([held.model, *held.data], factor), list[str]()
    else:
        result, notes = held.against().drift(factor)
    since = "\n".join(since_in_words(result)) or "no joint is beyond at the end"
    lines = f"beyond: {result.judged_by}", since
    print_result(drift_summary(result, notes), *drift_tables(result), *lines, notes=notes)
    if held.report is not None:
        write_drift_report(held.report, result, model=held.model.name, notes=notes)
        print_page(held.report)
    if any(first is not None for first in result.since):
        raise typer.Exit(FAULT_FOUND)


def _arm_drift(held: HeldModel) -> None:
    from catenary.workflows.identify import changes_of_files

    if held.report is not None or held.max_error is not None:
        raise InputError("drift: --report and --max-error do not go with an arm's parameters")
    changes, notes = changes_of_files(held.model, held.data, reading=held.reading(), accept=held.accept)
    columns: list[Column] = ["recording", "finding", ("joints", lambda one: ", ".join(one["joints"])), "says"]
    table = Table(columns, changes, "Changes") if changes else "no difference from the identification"
    print_result({"changes": changes, "notes": notes}, table, notes=notes)
    if changes:
        raise typer.Exit(FAULT_FOUND)


def _print_fit(out: Path, result: "FitResult") -> None:
    from catenary.calibration.evaluate import error_table, spread_table
    from catenary.reports.joint_errors import coverage_table
    from catenary.workflows.calibration_model import interval_summary, warnings_of

    held_out, card = result.held_out, card_path(out)
    notes = [*result.notes, *([] if held_out is None else warnings_of(held_out))]
    parts: list[Any] = [spread_table(result.spread)] if result.spread else []
    if held_out is not None:
        parts.append(error_table(held_out, title="RMSE and largest error on the held-out part"))
        parts.append(coverage_table(held_out))
    content = {
        "model": str(out),
        "card": str(card),
        "kind": result.model.kind,
        "preset": result.model.preset,
        "rows": len(result.data),
        "inputs": list(result.model.features.names),
        "cross_validation": [asdict(joint) for joint in result.spread],
        "held_out": None if held_out is None else [asdict(joint) for joint in held_out.joints],
        "intervals": None if held_out is None else interval_summary(held_out),
        "notes": notes,
    }
    print_result(content, *parts, f"model: {out}\ncard:  {card}", notes=notes)


def _write_fit_report(path: Path, result: "FitResult", robot: "catenary.RobotModel | None") -> None:
    from catenary.calibration.evaluate import evaluate as evaluate_rows
    from catenary.reports.calibration import write_calibration_report
    from catenary.reports.joint_errors import CAPTION, overlay
    from catenary.verdict.corrections import retimed_by

    overlays = (picture(overlay(log, retimed_by(log)), f"{log.name}. {CAPTION}") for log in result.logs)
    further: list[Block] = [Heading("Delay"), *overlays]
    tested_on, evaluation = "the held-out part of each recording", result.held_out
    if evaluation is None:
        tested_on = "the data that it was fitted to; the cross-validation below is the honest error"
        evaluation = evaluate_rows(result.model, result.data)
    write_calibration_report(
        path, result.model, result.card, evaluation,
        tested_on=tested_on, spread=result.spread, notes=result.notes, further=further,
        unseen=result.held_out is not None, robot=robot,
    )  # fmt: skip
