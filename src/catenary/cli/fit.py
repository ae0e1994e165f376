"""catenary fit and evaluate."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from catenary.cli.options import (
    Accept,
    AsJsonNotTables,
    MappingOptions,
    MendOptions,
    ModelMendOptions,
    robots_beginning,
)
from catenary.cli.out_files import MODEL, NAMED_AS_TYPED, PAGE, Report, out_path, refuse_outputs
from catenary.cli.terminal import (
    numbers,
    print_json,
    print_notes,
    print_table,
    progress_bar,
    words,
)
from catenary.errors import InputError
from catenary.files import card_path

if TYPE_CHECKING:
    from catenary.calibration.evaluate import Evaluation
    from catenary.calibration.fit_options import FitOptions, FitRun
    from catenary.calibration.fit_recordings import FitResult
    from catenary.robots.model import RobotModel

Recordings = Annotated[
    list[Path],
    Argument(
        metavar="DATA",
        help="Recordings: .npz with q_des, q_act, ok in rad and m, .parquet logs, RAVEN-II's published .csv; others "
        "with --map.",
    ),
]
LARGEST_SEED = 2**32 - 1  # that scikit-learn takes
Seed = Annotated[int, Option("--seed", metavar="N", min=0, max=LARGEST_SEED, help="Seed of all randomness.")]
MaxError = Annotated[
    str | None,
    Option("--max-error", metavar="E,E,...", help="Leave out rows with larger errors, per joint in deg, mm."),
]
Robot = Annotated[
    str | None,
    Option(
        metavar="ROBOT",
        help="Catalogue name or file of the robot: joint names and units.",
        autocompletion=robots_beginning,
    ),
]


@dataclass(frozen=True)
class ModelOptions:
    """Options of a fit."""

    model: Annotated[
        str,
        Option(
            metavar="KIND",
            help="offset, linear, polynomial, neural, or auto: for every joint the simplest of them that will do.",
        ),
    ] = "auto"
    preset: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="Preset of a neural model: paper (Peng et al.'s network) or best (ours). [default: best]",
        ),
    ] = None
    inputs: Annotated[
        str | None,
        Option(
            metavar="SIGNALS",
            help="What the model takes: groups q, tau, qd, all, or signals such as q:J1; per joint as "
            "'J1=q:J1,tau:J1;J2=q'. [default: q, and tau if recorded]",
        ),
    ] = None
    history: Annotated[int, Option(metavar="K", min=0, help="Also take the K previous commands.")] = 0
    play: Annotated[
        str | None,
        Option(
            metavar="SHARES",
            help="Also take play states (memory of a cable's slack) as wide as these shares of each joint's "
            "motion: 0.01,0.05,0.2, 'on' for ours, 'off'. [default: off; on for preset best without torques]",
        ),
    ] = None
    target: Annotated[
        str,
        Option(
            metavar="WHAT",
            help="What to learn: error, the joint error, or position, the joint position end to end.",
        ),
    ] = "error"
    ridge: Annotated[
        float | None,
        Option(
            metavar="R",
            min=0.0,
            show_default=False,
            help="Ridge penalty of linear and polynomial models: weight on their squared coefficients, of inputs "
            "that vary by 1. [default: 0; 10 with --play, and for polynomials with --history]",
        ),
    ] = None
    prior: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="What linear models and preset best begin at, for few minutes of data: simulated (what simulated "
            "robots have in common).",
        ),
    ] = None
    held_out: Annotated[
        float | None,
        Option(metavar="SHARE", help="Keep the last part of each recording, this share of it, for a test."),
    ] = None
    folds: Annotated[int, Option(metavar="N", min=0, help="Blocks of the cross-validation; 0 for none.")] = 5
    coverage: Annotated[
        float,
        Option(metavar="SHARE", help="Share of errors that the intervals about corrected joints hold."),
    ] = 0.9
    max_error: MaxError = None

    def options(self, seed: int) -> "FitOptions":
        """Return the options of the model.

        Args:
            seed: Of a network's training.
        """
        from catenary.calibration.fit_options import PLAY_SHARES, FitOptions

        return FitOptions(
            kind=self.model,  # type: ignore[arg-type]  # FitOptions refuses what it does not know
            preset=self.preset,  # type: ignore[arg-type]
            inputs=_inputs(self.inputs),
            history=self.history,
            play=_play_shares(self.play, PLAY_SHARES),
            target=self.target,  # type: ignore[arg-type]
            ridge=self.ridge,
            seed=seed,
            prior=self.prior,
        )

    def run(self, accept: list[str] | None, robot: str | None = None) -> "FitRun":
        """Return the options that do not belong to the model.

        Args:
            accept: Findings about the data to go on with, by name.
            robot: Its name.
        """
        from catenary.calibration.fit_options import FitRun

        return FitRun(
            robot=robot,
            max_error=limits(self.max_error),
            held_out=self.held_out,
            folds=self.folds,
            accept=tuple(accept or ()),
            coverage=self.coverage,
        )


def fit(
    data: Recordings,
    fitting: ModelOptions,
    mending: MendOptions,
    foreign: MappingOptions,
    out: Annotated[
        Path, Option(metavar="MODEL", parser=out_path, help=f"Model to write, e.g. arm.npz. {NAMED_AS_TYPED}")
    ],
    robot: Robot = None,
    seed: Seed = 0,
    accept: Accept = None,
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Fit a calibration model and print its error on unseen data.

    Example: catenary fit run1.npz --out arm.npz
    """
    from catenary.calibration.model_file import save_model
    from catenary.robots.catalog import load_robot
    from catenary.workflows.calibration_model import fit_calibration

    options = fitting.options(seed)
    arm = None if robot is None else load_robot(robot)
    names, own_units = (None, None) if arm is None else (arm.joint_names, arm.joint_units)
    reading = mending.reading(foreign, units=own_units, joint_names=names, robot=robot)
    run = fitting.run(accept, robot)
    refuse_outputs(
        {"--out": (out, MODEL), "the card of --out": (card_path(out), None), "--report": (report, PAGE)},
        [*data, *([Path(robot)] if robot else [])],
    )
    with progress_bar(f"fitting {fitting.model}") as progress:
        result = fit_calibration(data, options, run, reading=reading, progress=progress)
    save_model(result.model, result.card, out)
    if as_json:
        print_json(_fit_summary(out, card_path(out), result))
    else:
        _print_fit(out, card_path(out), result)
    if report is not None:  # last: whatever goes wrong with it, the model is there
        _write_fit_report(report, result, arm)
        if not as_json:
            print(f"page:  {report}")


def evaluate(
    model: Annotated[Path, Argument(metavar="MODEL", help="A model that catenary fit wrote.")],
    data: Recordings,
    mending: ModelMendOptions,
    foreign: MappingOptions,
    window: Annotated[
        float | None, Option(metavar="S", help="Length of a time window in s. [default: a tenth of the data]")
    ] = None,
    max_error: MaxError = None,
    accept: Accept = None,
    robot: Annotated[
        str | None,
        Option(
            metavar="ROBOT",
            help="Catalogue name or file of the robot: with --report, the error of its tip. [default: the model's]",
            autocompletion=robots_beginning,
        ),
    ] = None,
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Print a model's error on recordings, before and after.

    RMSE and maximum per joint in deg and mm, RMSE per window of time, share of errors within the intervals.

    Example: catenary evaluate arm.npz run2.npz --report run2.html
    """
    from catenary.reports.calibration import write_calibration_report
    from catenary.reports.error_tables import error_table, window_table
    from catenary.robots.catalog import load_robot
    from catenary.workflows.calibration_model import evaluate_calibration, evaluation_summary

    refuse_outputs({"--report": (report, PAGE)}, [model, *data])
    arm = None if robot is None else load_robot(robot)
    result = evaluate_calibration(
        model,
        data,
        reading=mending.reading(foreign),
        accept=tuple(accept or ()),
        max_error=limits(max_error),
        window=window,
    )
    if as_json:
        print_json(evaluation_summary(result))
    else:
        print_notes(result.notes)
        print_table("RMSE and largest error per joint", *error_table(result.evaluation))
        _print_coverage(result.evaluation)
        print_table("RMSE of the model over time", *window_table(result.evaluation))
    if report is not None:
        tested_on = ", ".join(source.name for source in result.evaluation.data.sources)
        if result.seen_in_training:
            tested_on += f" (no test: the model was fitted to {', '.join(result.seen_in_training)})"
        write_calibration_report(
            report, result.model, result.card, result.evaluation, tested_on=tested_on, notes=result.notes,
            unseen=not result.seen_in_training, robot=arm,
        )  # fmt: skip
        if not as_json:
            print(f"page: {report}")


def _print_fit(out: Path, card: Path, result: "FitResult") -> None:
    from catenary.reports.error_tables import error_table, spread_table
    from catenary.workflows.calibration_model import warnings_of

    print_notes(result.notes)
    for choice in result.choices:
        print(choice)
    if result.spread:
        print_table("RMSE on blocks of time that the fit did not see", *spread_table(result.spread))
    if result.held_out is not None:
        print_table("RMSE and largest error on the held-out part", *error_table(result.held_out))
        _print_coverage(result.held_out)
        print_notes(warnings_of(result.held_out))
    print(f"model: {out}\ncard:  {card}")


def _print_coverage(evaluation: "Evaluation") -> None:
    from catenary.reports.intervals import coverage_table, coverage_title

    if evaluation.level is not None:
        print_table(coverage_title(evaluation.level), *coverage_table(evaluation))


def _fit_summary(out: Path, card: Path, result: "FitResult") -> dict[str, Any]:
    from catenary.workflows.calibration_model import interval_summary, warnings_of

    held_out = result.held_out
    return {
        "model": str(out),
        "card": str(card),
        "kind": result.model.kind,
        "preset": result.model.preset,
        "choice": [asdict(choice) for choice in result.choices] or None,
        "rows": len(result.data),
        "inputs": list(result.model.features.names),
        "cross_validation": [asdict(joint) for joint in result.spread],
        "held_out": None if held_out is None else [asdict(joint) for joint in held_out.joints],
        "intervals": None if held_out is None else interval_summary(held_out),
        "notes": [*result.notes, *([] if held_out is None else warnings_of(held_out))],
    }


def _write_fit_report(path: Path, result: "FitResult", robot: "RobotModel | None") -> None:
    from catenary.calibration.evaluate import evaluate as evaluate_rows
    from catenary.reports.calibration import write_calibration_report

    tested_on, evaluation = "the held-out part of each recording", result.held_out
    if evaluation is None:
        tested_on = "the data that it was fitted to; the cross-validation below is the honest error"
        evaluation = evaluate_rows(result.model, result.data)
    write_calibration_report(
        path, result.model, result.card, evaluation,
        tested_on=tested_on, spread=result.spread, notes=result.notes, unseen=result.held_out is not None, robot=robot,
    )  # fmt: skip


def limits(max_error: str | None) -> tuple[float, ...] | None:
    """Return the error limits that --max-error gives, deg and mm."""
    return None if max_error is None else numbers("--max-error", max_error)


def _play_shares(text: str | None, ours: tuple[float, ...]) -> tuple[float, ...] | None:
    named = {None: None, "on": ours, "off": ()}
    return named[text] if text in named else numbers("--play", text or "")


def _inputs(text: str | None) -> tuple[str, ...] | dict[str, tuple[str, ...]] | None:
    if text is None or "=" not in text:
        return None if text is None else words(text)
    per_joint = {}
    for part in text.split(";"):
        joint, equals, chosen = part.partition("=")
        if not equals or not words(chosen):
            raise InputError(f"--inputs: expected 'JOINT=signal,signal;JOINT=...', got {part!r}")
        per_joint[joint.strip()] = words(chosen)
    return per_joint
