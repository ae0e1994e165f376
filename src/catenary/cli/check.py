"""catenary check and recover: what a file is, and what is whole of a damaged recording."""

from pathlib import Path

import typer

from catenary.cli.options import AS_JSON, Numbers, argument, option, robots_beginning
from catenary.cli.out_files import out_path
from catenary.cli.recording_options import MAX_ERROR, RecordingOptions
from catenary.cli.terminal import print_fact, print_json, print_notes, without_notes


def check(
    recordings: RecordingOptions,
    file: str = argument("FILE", "A robot, a calibration model or a recording.", completes=robots_beginning),
    max_error: Numbers | None = MAX_ERROR,
    robot: str | None = option("ROBOT", "Robot of a recording: its limits, and joints' names and units."),
    as_json: bool = AS_JSON,
) -> None:
    """Say what a file is and what is wrong with it.

    The exit code is 1 when something is wrong. Robots are catalogue names, .toml, .urdf, .xml and .mjcf files;
    models are .npz; recordings .npz, .parquet or RAVEN-II's published .csv. A recording gets the verdict that
    catenary fit begins with, mended by the same options. --json prints facts as numbers with units (docs/formats.md).

    Example: catenary check run1.npz --swap J1,J2
    """
    from catenary.workflows.check import check_file

    with without_notes(True):  # what is doubtful is among the faults below
        finding = check_file(file, recordings.reading(robot), robot=robot, max_error=max_error)
    if as_json:
        print_json(finding.as_data())
    else:
        print(f"{file}: {finding.kind}")
        lines = finding.facts.in_words()
        width = max(len("remark:"), *(len(name) for name, _ in lines))
        for name, text in lines:
            print_fact(name, text, width=width)
        for remark in finding.remarks:
            print_fact("remark:", remark, width=width)
        for fault in finding.faults:
            print_fact("WRONG:", fault, width=width)
        print(f"  {len(finding.faults)} fault(s) found" if finding.faults else "  nothing wrong found")
    if finding.faults:
        raise typer.Exit(1)


def recover(
    recording: Path = argument(
        "RECORDING", "Journal (folder or one of its files), .bag, .mcap or its folder."
    ),
    out: Path | None = option(
        "PATH", "What to write, named as typed. [default: NAME.recovered beside it]", read=out_path
    ),
    as_json: bool = AS_JSON,
) -> None:
    """Write what is whole of a damaged recording.

    Says what is lost. For recordings that were cut off, not closed, or damaged in the middle, outside a project
    (inside, `catenary extract` does it). Of a journal it writes a journal (folder), of a ROS 1 bag a .bag, of MCAP a
    ROS 2 bag (folder); all of them go into `catenary` and other programs like any other. RECORDING is not changed,
    and nothing is overwritten. A whole one is told so, and nothing is written.
    """
    from catenary.workflows.recover import recover as recover_recording

    found = recover_recording(recording, out)
    if as_json:
        print_json(found.as_data())
        return
    from catenary.reports.page import Column, Table

    columns = [
        Column("topic", "topic"),
        Column("kept", "kept"),
        Column("lost, about", "lost"),
        Column("without messages [s]", "seconds", ".2f"),
    ]
    print(Table(columns, found.rescue.topics, f"{recording}: {found.rescue.seconds:.1f} s").text())
    print_notes(found.problems)
    if found.written is None:
        print("whole: nothing to recover, nothing written")
        return
    if found.rescue.ends_early:
        print("cut off: what came last, up to 0.5 s and what the disk took, and all behind it is lost")
    print(f"written: {found.written}")
