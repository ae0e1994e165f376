"""catenary identify, payload."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from catenary.cli.gravity_source import ImuReading, gravity_of_reading
from catenary.cli.options import (
    Accept,
    AsJsonNotTables,
    MappingOptions,
    MendOptions,
    ModelMendOptions,
    robots_beginning,
)
from catenary.cli.out_files import (
    NAMED_AS_TYPED,
    PAGE,
    PARAMETERS,
    URDF,
    Report,
    out_path,
    refuse_outputs,
)
from catenary.cli.terminal import numbers, print_json, print_notes, print_table, words
from catenary.errors import InputError
from catenary.files import card_path

Logs = Annotated[
    list[Path],
    Argument(
        metavar="LOG",
        help="Recordings: .npz with q, dq, tau and fs or t in rad, m, s, Nm, N; or .parquet logs; others with --map.",
    ),
]
Gravity = Annotated[
    str | None,
    Option("--gravity", metavar="X,Y,Z", help="Gravity vector in base axes, m/s2. [default: 0,0,-9.81]"),
]
CutOff = Annotated[
    float | None,
    Option("--cutoff-hz", metavar="F", help="Cut-off of the filter. [default: the robot file's]"),
]


def identify(
    logs: Logs,
    mending: MendOptions,
    foreign: MappingOptions,
    robot: Annotated[
        str,
        Option(
            metavar="ROBOT", help="Catalogue name or file; needs no inertia.", autocompletion=robots_beginning
        ),
    ],
    out: Annotated[
        Path,
        Option(metavar="FILE", parser=out_path, help=f"Parameters to write, e.g. arm.npz. {NAMED_AS_TYPED}"),
    ],
    test: Annotated[
        list[Path] | None, Option(metavar="LOG", help="A recording to judge the result by; may be repeated.")
    ] = None,
    terms: Annotated[str, Option(metavar="WHAT", help="full: all dynamics; static: poses at rest.")] = "full",
    cutoff_hz: CutOff = None,
    period: Annotated[
        int | None,
        Option(metavar="N", min=1, help="Samples of the motion's period. [default: the robot file's]"),
    ] = None,
    weighting: Annotated[
        str | None,
        Option(
            metavar="HOW",
            help="Weight of the axes: none, range or spread of the torque, residual. [default: the robot file's]",
        ),
    ] = None,
    consistent: Annotated[
        bool,
        Option(
            "--consistent/--free",
            help="Physically possible parameters only: positive mass, inertia, friction; or any that fit.",
        ),
    ] = True,
    friction: Annotated[
        str | None,
        Option(
            metavar="PART,...",
            help="Parts that held-out blocks may add to Coulomb and viscous friction: asymmetric, stribeck, load, "
            "presliding; or none. [default: all]",
        ),
    ] = None,
    prior: Annotated[
        bool,
        Option("--prior/--no-prior", help="Draw towards the masses of the robot's file, where it has any."),
    ] = True,
    blocks: Annotated[
        float | None, Option(metavar="S", help="Hold out every second block of S seconds (static: S rows).")
    ] = None,
    rows: Annotated[str | None, Option(metavar="A:B", help="Rows of LOG to fit. [default: all]")] = None,
    gravity: Gravity = None,
    imu_reading: ImuReading = None,
    accept: Accept = None,
    urdf: Annotated[
        Path | None,
        Option(metavar="FILE", parser=out_path, help="Also write the robot as URDF; not with --free."),
    ] = None,
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Identify an arm's dynamics from recordings of it.

    Example: catenary identify psm_one.npz --robot dvrk_psm_motors --test another_day.npz --out psm.npz
    """
    from catenary.identification.identification_file import save_identification
    from catenary.identification.identify_options import FRICTION_PARTS, IdentifyOptions
    from catenary.reports.identification import absolute_table, excitation_facts, mass_table, residual_table
    from catenary.workflows.identify import identify_files

    options = IdentifyOptions(
        terms=terms,  # type: ignore[arg-type]  # IdentifyOptions refuses what it does not know
        gravity=gravity_vector(gravity, imu_reading),
        cutoff_hz=cutoff_hz,
        period_samples=period,
        weighting=weighting,  # type: ignore[arg-type]
        consistent=consistent,
        friction=FRICTION_PARTS if friction is None else () if friction == "none" else words(friction),
        prior=prior,
        blocks=blocks,
    )
    tests = test or []
    if urdf is not None and not consistent:
        raise InputError("--urdf: only a physically consistent fit gives links an inertia; leave --free out")
    refuse_outputs(
        {
            "--out": (out, PARAMETERS),
            "the card of --out": (card_path(out), None),
            "--report": (report, PAGE),
            "--urdf": (urdf, URDF),
        },
        [*logs, *tests, Path(robot)],
    )
    result = identify_files(
        logs,
        robot,
        options,
        tests=tests,
        rows=_rows(rows),
        reading=mending.reading(foreign),
        accept=tuple(accept or ()),
    )
    found = result.identification
    save_identification(found, result.card, out)
    if urdf is not None:
        from catenary.robots.urdf_export import write_urdf

        write_urdf(found.robot(), urdf)
    if as_json:
        print_json({**result.summary(), "file": str(out), "card": str(card_path(out))})
    else:
        print_notes(result.notes)
        print_table("Residual over torque (RMS) per axis", *residual_table(found))
        print_table("RMS residual", *absolute_table(found))
        if (masses := mass_table(found)) is not None:
            print_table("Links beside the robot's file; single masses are plausible, not measured", *masses)
        for name, text in excitation_facts(found)[:2]:
            print(f"{name}: {text}")
        print(f"parameters: {out}\ncard:  {card_path(out)}")
    if report is not None:  # last: whatever goes wrong with it, the parameters are there
        from catenary.reports.identification import write_identification_report

        shown = result.tests or result.training
        write_identification_report(report, found, result.card, shown, notes=result.notes)
        if not as_json:
            print(f"page:  {report}")


def gravity_vector(text: str | None, reading: str | None) -> tuple[float, float, float]:
    """Return the gravity that --gravity or --imu-reading gives, level when neither does."""
    from catenary.identification.identify_options import NOMINAL_GRAVITY

    if reading is not None:
        if text is not None:
            raise InputError("give one of --gravity and --imu-reading")
        x, y, z = gravity_of_reading(reading).tolist()
        return x, y, z
    x, y, z = NOMINAL_GRAVITY if text is None else numbers("--gravity", text, 3)
    return x, y, z


def _rows(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    first, _, last = text.partition(":")
    try:
        return int(first), int(last)
    except ValueError:
        raise InputError(f"--rows: expected FIRST:LAST, such as 921:6791, got {text!r}") from None


def payload(
    logs: Logs,
    mending: ModelMendOptions,
    foreign: MappingOptions,
    model: Annotated[Path, Option(metavar="FILE", help="Parameters that catenary identify wrote.")],
    at: Annotated[
        tuple[str, float, float, float] | None,
        Option(metavar="FRAME X Y Z", help="Place of the payload in a frame, in m. [default: anywhere]"),
    ] = None,
    unloaded: Annotated[
        list[Path] | None,
        Option(metavar="LOG", help="A recording of the same day without payload; may be repeated."),
    ] = None,
    cutoff_hz: CutOff = None,
    accept: Accept = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Estimate the payload of an identified arm.

    Example: catenary payload loaded.npz --model psm.npz --at pitch 0.024 0.535 0
    """
    from catenary.workflows.identify import payload_of_files

    place = None if at is None else (at[0], at[1:])
    result = payload_of_files(
        logs,
        model,
        at=place,
        unloaded=unloaded or [],
        cutoff_hz=cutoff_hz,
        reading=mending.reading(foreign),
        accept=tuple(accept or ()),
    )
    if as_json:
        print_json(result.summary())
        return
    print_notes(result.notes)
    best = result.payload
    if best.detected:
        sure = f" (probability {best.probability:.2f})" if len(best.likely) == 1 and at is None else ""
        print(f"payload {best.location}{sure}")
    else:
        print(f"no payload (confidence {best.confidence:.3f} that there is one)")
    if best.detected and len(best.likely) > 1:
        print(f"if it is on {best.link}:")
    told = best.detected or at is not None
    if best.mass is not None and told:
        print(f"mass: {1000 * best.mass:.1f} g, standard deviation {1000 * (best.mass_std or 0.0):.1f} g")
    if best.moment is not None and best.moment_std is not None and told:
        print(
            f"mass times place in {best.link}: {', '.join(f'{v:.4f}' for v in best.moment)} kg m, standard deviations "
            f"{', '.join(f'{v:.4f}' for v in best.moment_std)}"
        )
    if result.candidates:
        print_table(
            "Links that could carry it, and what it would explain of the residual there",
            ["link", "probability", "explained"],
            [
                [c.link, f"{c.probability:.2f}", f"{100 * c.explained:.1f} %"]
                for c in (best, *result.candidates)
            ],
        )
