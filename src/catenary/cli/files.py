"""catenary check, recover, import, export: identify a file, recover it, and convert from and to other formats."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from catenary.cli.exit_codes import FAULT_FOUND
from catenary.cli.options import REQUIRED, Numbers, argument, option
from catenary.cli.out_files import HEADER, LOG, NAMED_AS_TYPED, PICTURE, out_path
from catenary.cli.recording_options import MAX_ERROR, MappingOptions, RecordingOptions, calibration_of
from catenary.cli.robot_options import LoadedOptions, one_or_each
from catenary.cli.terminal import print_notes, print_result, prints_json, progress_bar, without_notes
from catenary.errors import InputError
from catenary.files import write_atomically
from catenary.reports.page import write_picture
from catenary.tables import Column, Table


def check(
    recordings: RecordingOptions,
    file: str = argument("ROBOT|FILE", "A robot, a calibration model, a recording, or a bag's folder."),
    max_error: Numbers | None = MAX_ERROR,
    robot: str | None = option("ROBOT", "Robot of a recording: its limits, and joints' names and units."),
    picture: Path | None = option("FILE", "Also draw commands over measurements, .png, .svg or .pdf.", writes=PICTURE),
) -> None:
    """Identify a file, check it, and suggest the next command.

    The exit code is 1 when something is wrong. Robots are catalogue names, .toml, .urdf, .xml, .mjcf, .json;
    models are .npz; recordings bags of ROS 1 and 2, MCAP, journals, .npz, .parquet, .csv. A recording gets the verdict
    that catenary fit begins with, corrected by the same options. --json prints numbers with units (docs/json.md).

    Example: catenary check run1.npz --swap J1,J2
    """
    from catenary.workflows.check import check_file

    with without_notes(True):  # what is doubtful is among the faults below
        typed = recordings.typed(robot)
        found = check_file(file, recordings.reading(robot), robot=robot, max_error=max_error, typed=typed)
    if picture is not None:
        if found.draw is None:
            raise InputError("--picture: is of a recording with measured joint positions")
        write_picture(found.draw(), picture, PICTURE.endings)
    joints = None if found.joints is None else found.joints.text().rstrip()
    facts = [("remark:", text) for text in found.shown_remarks] + [("WRONG:", text) for text in found.faults]
    facts += [("verdict", found.verdict), *([("next", found.next)] if found.next else [])]
    print_result(found.as_data(), f"{file}: {found.kind}", list(found.lines), joints, facts)
    if found.faults:
        raise typer.Exit(FAULT_FOUND)


def recover(
    recording: Path = argument("RECORDING", "Journal (folder or one of its files), .bag, .mcap or its folder."),
    out: Path | None = option("PATH", "Recording to write. [default: NAME.recovered, in its folder]", read=out_path),
) -> None:
    """Recover the intact part of a damaged recording.

    It reports how much is kept and lost, and from when to when no message is left. Use it for recordings that were cut
    off, not closed, or damaged in the middle, outside a project (inside one, `catenary extract` does it). A journal
    becomes a journal (folder), a ROS 1 bag a .bag, MCAP a ROS 2 bag (folder). RECORDING is not changed, nothing is
    overwritten, and an intact recording writes nothing.
    """
    from catenary.workflows.recover import recover as recover_recording

    found = recover_recording(recording, out)
    columns: list[Column] = ["topic", "kept", ("lost, about", "lost"), ("without messages [s]", "seconds:.2f")]
    table = Table(columns, found.rescue.topics, f"{recording}: {found.rescue.seconds:.1f} s")
    lines = ["whole: nothing to recover, nothing written"]
    if found.written is not None:
        lines = [*found.rescue.stretches(), f"written: {found.written}"]
    print_result(found.as_data(), table, *lines, notes=found.problems)


def export(
    loaded: LoadedOptions,
    robot: str | None = argument("[ROBOT]", "Catalogue name or file; none for the correction of --model alone.", None),
    c: Path = option("OUT", f"C header to write, e.g. arm.h. {NAMED_AS_TYPED}", REQUIRED, writes=HEADER),
    model: Path | None = option("MODEL", "Calibration model for the header."),
    rate_hz: float = option("HZ", "Rate of the loop.", 1000.0),
    friction: Numbers | None = option("F,F,...", "Coulomb friction of the joints in Nm and N."),
    viscous: Numbers | None = option("F,F,...", "Viscous friction in Nms/rad and Ns/m, likewise."),
    tool: Path | None = option(
        "FILE", "Also subtract this tool from wrist forces; a file that catenary payload --tool wrote."
    ),
) -> None:
    """Write a robot and a calibration model as C.

    It holds the dynamics (feedforward, inverse dynamics on a moving base, mass matrix, gravity) and the joint
    correction, for loops in C and C++, without libraries or allocation.

    Example: catenary export --model arm.npz --c arm.h
    """
    from catenary.dynamics.actuation_loads import joint_friction
    from catenary.sensing.wrist_tool import load_tool
    from catenary.workflows.c_header import c_header

    if robot is None and model is None:
        raise InputError("export: expected a robot, or --model for its correction alone")
    if robot is None and (loaded.payload or friction or viscous or tool):
        raise InputError("export: --payload, --friction, --viscous and --tool are for a robot")
    known = None if robot is None else loaded.load(robot)
    calibration = calibration_of(model)
    loads = None
    if known is not None and (friction or viscous):
        loads = joint_friction(known, *(one_or_each(forces or (0.0,)) for forces in (friction, viscous)))
    carried = None if tool is None else load_tool(tool)
    header = c_header(known, calibration, rate_hz=rate_hz, loads=loads, tool=carried)
    write_atomically(c, header.text.encode("ascii"))
    facts = [("written", str(c)), ("functions", ", ".join(header.functions))]
    print_notes(header.notes)
    print_result({"file": str(c), "functions": header.functions}, facts)


def import_recording(
    foreign: MappingOptions,
    sources: Sequence[Path] = argument(
        "SOURCE...", "Files of one recording: bags, .mcap, .csv, .txt, .parquet, .npz, .npy, .mat."
    ),
    out: Path | None = option("LOG", f"Motion log to write, e.g. lab.parquet. {NAMED_AS_TYPED}", writes=LOG),
    units: str | None = option("U,U,...", "rad, deg, m or mm per joint, or one for all, where a mapping has none."),
    robot: str | None = option("ROBOT", "Catalogue name or file: names and units of the joints."),
    clock: Sequence[str] = option(
        "SECONDS,PPM", "Offset and drift of other files' clocks against q_nominal's; FILE=... of one."
    ),
    yes: bool = option(None, "Accept the proposed mapping, unless a question is open.", False),
    answer: Sequence[str] = option("QUESTION=ANSWER", "Answer an open question, as q_encoder=cam; repeatable."),
) -> None:
    """Import a third-party recording into a motion log.

    Every command reads that log. Without a mapping it prints the one that it proposes, as TOML to edit; files of a
    known layout need none.

    Example: catenary import lab.bag --map q_nominal=/arm/joint_cmd.position --map q_encoder=/camera/joints.position@deg
    --units deg,deg,mm --out lab.parquet
    """
    from catenary.plant import joints_text
    from catenary.recording.import_formats.proposal import answers_of
    from catenary.workflows.import_recording import import_to_file, known_layout, propose_mapping

    mapping, answers = foreign.read(units, robot=robot, clock=clock or None), answers_of(answer)
    layout = None if answers else known_layout(sources, robot=robot)
    if mapping is None and layout is None and not ((yes or answers) and out is not None):
        proposal = propose_mapping(sources, units=units, robot=robot, answers=answers)
        content = {"proposal": proposal.toml, "decisions": proposal.decisions, "questions": proposal.questions}
        print_result({**content, "not_used": proposal.not_used}, proposal.toml.rstrip("\n"))
        todo = "answer the OPEN questions (or use --answer, with --out), " if proposal.questions else "check it, "
        note = f"this is a proposal; nothing was imported. Write it to a file, {todo}and: catenary import "
        note += f"{shlex.join(map(str, sources))} --mapping FILE.toml --out LOG.parquet"
        note += "" if proposal.questions else ", or accept it: --yes --out LOG.parquet"
        print_notes([note] * (not prints_json()))
        if out is not None:
            raise InputError(f"--out {out}: nothing was written: there is no mapping yet")
        return
    if out is None:
        raise InputError("--out: where does the log go? expected --out LOG.parquet")
    with progress_bar("import") as progress:
        done = import_to_file(
            out,
            sources,
            mapping,
            units=units,
            robot=robot,
            accept_proposal=yes,
            answers=answers,
            clock=clock,
            progress=progress,
        )
    log = done.log
    doubts = [f"{finding.name}: {finding}" for finding in done.findings if finding.refuses]
    delay = next((str(finding) for finding in done.findings if finding.name in ("delay", "clock")), None)
    joints = dict(zip(log.joint_names, log.joint_units, strict=True))
    report: dict[str, Any] = {
        "log": str(out), "layout": layout, "rows": done.rows, "seconds": done.seconds, "measured": done.measured,
        "joints": joints, "not_used": done.not_used, "notes": done.notes, "doubts": doubts, "delay": delay,
    }  # fmt: skip
    rows = f"{done.rows}{'' if done.seconds is None else f', {done.seconds:.1f} s'}"
    rows += f", {done.measured or 'none'} of them with q_encoder" + (", which a fit needs" * (not done.measured))
    facts = [("joints:", joints_text(log)), ("rows:", rows)]
    facts += [*([] if delay is None else [("delay:", delay)]), ("log:", str(out))]
    notes = [*done.notes, *(f"a fit will refuse this log: {doubt}" for doubt in doubts)]
    notes += [
        f"{finding.name}: {finding}" for finding in done.findings if not finding.refuses and str(finding) != delay
    ]
    notes += ["if columns hold measured joints, name them: --map q_encoder=COLUMNS"] * (not done.measured)
    print_result(report, facts, notes=notes)
