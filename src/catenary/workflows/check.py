"""Check a file (robot, calibration model, identified dynamics or recording) and report facts and faults on one screen.

Facts are numbers with units for programs (docs/json.md), and lines of text. Positions have a joint's `unit` (rad, m),
errors its `error_unit` (deg, mm); None means not stated.
"""

import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any
from zipfile import is_zipfile

import numpy as np

from catenary.archives import read_arrays
from catenary.calibration.card import clock_delay
from catenary.calibration.dataset import date_of
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_file import load_model
from catenary.calibration.recordings import error_limits
from catenary.errors import CatenaryError, ExcitationError, FileFormatError, InputError
from catenary.file_formats import endings, format_named, format_of
from catenary.files import card_path, card_text
from catenary.gravity.mass_plausibility import mass_doubts
from catenary.identification.explanations.findings import explained_torques
from catenary.identification.identification import Identification, identify_samples
from catenary.identification.identification_file import load_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import check_positions, prepare
from catenary.plant import MotionLog, joints_text
from catenary.recording.bag_reader import METADATA, bags_in, is_journal
from catenary.recording.import_formats.imu_recording import read_imu
from catenary.recording.import_formats.recording_files import needs_mapping
from catenary.recording.logs import Reading, read_recording, read_torque_log
from catenary.reports.calibration import card_facts, model_name
from catenary.reports.joint_errors import overlay
from catenary.robots.actuation import joint_drives
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.tables import Column, Table
from catenary.units import DISPLAY
from catenary.verdict.check import MAX_ERROR_OPTION, judged, repeated_findings, robot_of
from catenary.verdict.command_response import MOVED_DEG_MM, OUTLIER_SIGMAS, hysteresis_of, outliers
from catenary.verdict.corrections import NO_MEND, Mend, retimed_by, units_of
from catenary.verdict.finding import Finding
from catenary.verdict.timestamps import stamp_findings
from catenary.workflows.import_recording import import_recording, known_layout, propose_mapping
from catenary.workflows.project.folder import SETTINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_FORMAT = "catenary.check.1"  # of the output of --json
_SCREEN_ROWS = 18  # rows of a screen of 24 for facts, joints, faults and remarks (two rows each)
_MAX_REMARK_LENGTH = 170  # characters of a remark on the screen
Line = tuple[str, str]  # name and text of a fact
_SOUND = "nothing wrong found"
_DOUBTED_NOTES = ("jump", "drift", "filled", "missing", "units")  # notes that put the errors in doubt


@dataclass
class FileReport:
    """Kind, facts and faults of a file."""

    kind: str  # "robot", "calibration model", "identified dynamics" or a recording
    facts: dict[str, Any] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)  # the facts as text
    faults: list[str] = field(default_factory=list)  # problems that make the file unfit or its numbers doubtful
    remarks: list[str] = field(default_factory=list)  # notes
    findings: tuple[Finding, ...] = ()  # about a recording, also listed as faults or remarks
    joints: Table | None = None  # of a recording
    hiding: list[str] = field(default_factory=list)  # faults that the recording cannot reveal
    draw: "Callable[[], Figure] | None" = None  # plots a recording's delay
    next: str = ""  # the next command line, or other advice

    def add(self, key: str, fact: Any, text: str | None = None, *, called: str = "") -> None:
        """Add a fact, and its line of text (the fact itself if None)."""
        self.facts[key] = fact
        self.lines.append((called or key.replace("_", " "), str(fact) if text is None else text))

    @property
    def verdict(self) -> str:
        """Summary in one sentence."""
        if self.faults:
            return f"{len(self.faults)} fault(s) found"
        doubted = [
            " of ".join(filter(None, (x.name, ", ".join(x.joints)))) for x in self.findings if x.name in _DOUBTED_NOTES
        ]
        none = {f"{x.name}: {x}" for x in self.findings if x.delay is not None and x.delay.sure == "none"}
        count = len(set(self.remarks) - none)
        sound = f"no fault found, {count} remark{'s' * (count > 1)}" if count else _SOUND
        return "; ".join([*([f"in doubt: {', '.join(doubted)}"] if doubted else []), sound, *self.hiding])

    @property
    def shown_remarks(self) -> list[str]:
        """Remarks that fit on a screen, without findings that have a line among the facts."""
        if self.joints is None:
            return self.remarks
        shown = ("units not stated", *(f"{name}: " for name, _ in self.lines))
        remarks = [
            shorten(remark, _MAX_REMARK_LENGTH, placeholder=" ...")
            for remark in self.remarks
            if not remark.startswith(shown)
        ]
        room = _SCREEN_ROWS - len(self.lines) - len(self.joints.records) - 2 * len(self.faults)
        max_lines = max(1, room // 2 - 1)
        more = len(remarks) - max_lines
        return [*remarks[:max_lines], *[f"{more} more, and all of these whole: --json"] * (more > 0)]

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        content = {key: getattr(self, key) for key in ("kind", "facts", "faults", "remarks")}
        findings = [asdict(finding) for finding in self.findings]
        return {"format": _FORMAT, **content, "findings": findings, "verdict": self.verdict, "next": self.next}


_GAP_STEPS = 10.0  # median steps between stamps above which a step is a gap
_MIN_REVERSALS = 6  # least reversals of a joint that show its slack and hysteresis
Limits = tuple[float, ...] | None


@dataclass(frozen=True)
class TypedRecording:
    """Recording as typed on the command line, from which the next command is composed."""

    name: str  # of the file or folder
    options: tuple[str, ...] = ()  # for reading: mapping, robot
    imports: tuple[str, ...] | None = None  # options of a necessary import; None if none is necessary

    def command(self, verb: str, options: Sequence[str], written: str) -> str:
        """Return the command line for a verb, whose output is named after the recording plus `written`."""
        stem = Path(self.name).with_suffix("").name
        words = ["catenary", verb, self.name, *self.options, *options, "--out", f"{stem}{written}"]
        if self.imports is None:
            return shlex.join(words)
        log = f"{stem}.parquet"
        first = ["catenary", "import", self.name, *self.imports, "--out", log]
        robot = self.options if verb == "identify" else ()
        return f"{shlex.join(first)} && {shlex.join(['catenary', verb, log, *robot, *words[3 + len(self.options) :]])}"


def check_recording(
    log: MotionLog,
    source: TypedRecording | None = None,
    *,
    mend: Mend = NO_MEND,
    robot: str | None = None,
    max_error: Limits = None,
    layout: str = "",
) -> FileReport:
    """Check a recording for calibration; corrections in the suggested command have been tested on it.

    `source` states how it was read (by default a motion log of its name), `robot` is a name or file (by default its
    own). Rows with errors beyond `max_error`, per joint in deg and mm, are left out.
    """
    source = source if source is not None else TypedRecording(f"{log.name}.parquet")
    as_read, log = log, mend(log)
    arm = robot_of([log], robot)
    findings, mended, cured, unsolved = judged(as_read, mend, robot=arm, max_error=error_limits(max_error, log))
    suggested = [
        finding.remedy.removeprefix(f"{MAX_ERROR_OPTION} ")
        for finding in findings
        if finding.remedy.startswith(f"{MAX_ERROR_OPTION} ")
    ]
    limits = ",".join(f"{limit:g}" for limit in max_error) if max_error is not None else next(iter(suggested), "")
    report = recording_report("recording", log, arm, cured)
    report.lines[0] = ("recording", f"{layout}{', ' if layout else ''}{report.lines[0][1]}")
    report.findings = findings
    report.remarks = [f"{finding.name}: {finding}" for finding in findings if not finding.refuses]
    seen = [j for j in report.facts["joints"] if (j["highest"] - j["lowest"]) * DISPLAY[j["unit"]][1] > MOVED_DEG_MM]
    rare = [f"{j['name']} {j['reversals']} times" for j in seen if j["reversals"] < _MIN_REVERSALS]
    report.remarks += [f"few reversals ({', '.join(rare)}): slack and hysteresis are uncertain"] * bool(rare)
    lost = int((~log.ok).sum())
    if log.q_encoder is None:
        report.faults.append("no measured joint positions (q_encoder): it cannot be calibrated from")
        robot_of_it = [] if "--robot" in source.options else ["--robot", log.robot or "ROBOT"]
        report.next = "measure the joints by a camera or encoders, and import that too: --map q_encoder=COLUMNS"
        report.next = report.next if log.tau is None else source.command("identify", robot_of_it, "_arm.npz")
    else:
        report.next = (
            f"no option corrects {', '.join(unsolved)}: bring in the right columns (catenary import), or record again"
            if unsolved
            else source.command("fit", [*mended.options, *([MAX_ERROR_OPTION, limits] if limits else [])], "_model.npz")
        )
        report.remarks += [f"{lost} rows without a trusted measurement are used as history only"] * (
            0 < lost < len(log)
        )
    report.remarks += [note for note in log.notes if not note.endswith("have no q_encoder")]
    report.faults += [f"{finding.name}: {finding}" for finding in findings if finding.refuses]
    _add_delay_and_outliers(report, findings)
    if log.q_encoder is not None:
        delay = report.facts["delay"] or {}
        before, shift = retimed_by(log), delay["seconds"] if delay.get("sure") in ("certain", "likely") else 0.0
        report.draw = lambda: overlay(log, before, -shift)
    return report


def _add_delay_and_outliers(report: FileReport, findings: Sequence[Finding]) -> None:
    """Add facts and lines on delay and outliers, and the delays that could be hidden to the verdict."""
    delay = next((finding.delay for finding in findings if finding.delay is not None), None)
    report.facts["delay"] = None if delay is None else asdict(delay)
    report.lines += [("delay", finding.says) for finding in findings if finding.name == "delay"]
    measured = report.facts["measured_rows"]
    wild = ", ".join(f"{j['name']} {j['outliers']}" for j in report.facts["joints"] if j["outliers"])
    outliers = f"{wild} of {measured:,} rows, beyond {OUTLIER_SIGMAS:g} robust standard deviations" if wild else "none"
    report.lines += [("outliers", outliers)] * bool(measured)
    if delay is not None and delay.sure != "certain":
        report.hiding = [f"a delay within {delay.low:+.3f} to {delay.high:+.3f} {delay.unit} would hide"]


def recording_report(
    kind: str, log: MotionLog, robot: RobotModel | None = None, cured: MotionLog | None = None
) -> FileReport:
    """Return a report of a recording's contents, without findings.

    Joints are compared with the robot's limits; slack and hysteresis are estimated from `cured`, the corrected log.
    """
    report = FileReport(kind, dict.fromkeys(("duration_s", "median_step_s", "gaps", "longest_gap_s")))
    measured = int(log.ok.sum()) if log.q_encoder is not None else 0
    began, units = log.began + (0.0 if log.time is None else float(log.time[0])), _units(log)
    report.facts |= {key: getattr(log, key) for key in ("name", "robot", "simulated", "sha256")}
    report.facts |= {"rows": len(log), "measured_rows": measured, "recorded": date_of(began), "units_from": units}
    rows = f"{len(log):,} rows, {f'{measured:,}' if measured else 'none'} with a trusted measurement"
    of = f"{log.robot or 'not stated'}{', simulated' if log.simulated else ''}"
    report.lines += [("recording", rows), ("robot", f"{of}; {date_of(began) or 'date not stated'}")]
    steps = np.diff(np.empty(0) if log.time is None else log.time)
    if len(forward := steps[steps > 0.0]):
        duration, median = float(forward.sum()), float(np.median(forward))
        gaps, longest = int((forward > _GAP_STEPS * median).sum()), float(forward.max())
        report.facts |= {"median_step_s": median, "gaps": gaps, "longest_gap_s": longest if gaps else None}
        long = f"{gaps} gaps longer than {_GAP_STEPS:g} steps, the longest {longest:.3g} s" if gaps else "no gaps"
        timing = f"{duration:.1f} s, median step {median:.4g} s ({1.0 / median:.4g} Hz), {long}"
        report.add("duration_s", duration, timing, called="duration")
    report.lines.append(("units", f"{', '.join(log.joint_units)}: {units}"))
    report.facts["joints"] = _joints(log, robot, log if cured is None else cured)
    report.joints = _table(report.facts["joints"], measured=log.q_encoder is not None)
    return report


def _units(log: MotionLog) -> str:
    stated = [text for key, texts in log.settled.items() if key.startswith("units") for text in texts]
    if stated:
        return f"converted by --units ({'; '.join(stated)})"
    if log.units_assumed:
        return "assumed, as they are not stated"
    return "as its file or its mapping states" if "units" in log.settled else "as --robot or --units says"


def _joints(log: MotionLog, robot: RobotModel | None, cured: MotionLog) -> list[dict[str, Any]]:
    """Return the range of each joint in its unit, and its errors in deg or mm."""
    rows = []
    for j, (name, unit, shown) in enumerate(zip(log.joint_names, log.joint_units, hysteresis_of(cured), strict=True)):
        low, high = float(log.q_nominal[:, j].min()), float(log.q_nominal[:, j].max())
        joint: dict[str, Any] = {"name": name, "unit": unit, "lowest": low, "highest": high, "share_of_limits": None}
        joint |= {"reversals": shown.reversals, "error_unit": DISPLAY[unit][0]}
        joint |= dict.fromkeys(("error_rms", "error_largest", "outliers"))
        if robot is not None and (name, unit) in zip(robot.joint_names, robot.joint_units, strict=True):
            k = robot.joint_names.index(name)
            reach = float(robot.upper[k] - robot.lower[k])
            joint["share_of_limits"] = (high - low) / reach if 0.0 < reach < np.inf else None
        if log.q_encoder is not None and log.ok.any():
            error = DISPLAY[unit][1] * (log.q_encoder - log.q_nominal)[log.ok, j]
            joint |= {"error_rms": float(np.sqrt(np.mean(error**2))), "error_largest": float(np.abs(error).max())}
            joint["outliers"] = int(outliers(error[:, None])[0][0])
        widths = {"hysteresis": shown.loop, "slack": shown.slack}
        rows.append(joint | {key: float(x) if np.isfinite(x) else None for key, x in widths.items()})
    return rows


def _table(joints: Sequence[dict[str, Any]], *, measured: bool) -> Table:
    def reach(j: dict[str, Any]) -> str:
        low, high = (DISPLAY[j["unit"]][1] * j[key] for key in ("lowest", "highest"))
        return f"{low:.2f} to {high:.2f} {j['error_unit']}"

    columns: list[Column] = [("joint", "name"), ("range", reach), ("of limits", "share_of_limits:.0f %"), "reversals"]
    if measured:
        columns += [("error RMS", "error_rms:.3f"), ("largest", "error_largest:.2f")]
        columns += [(width, f"{width}:.2f") for width in ("hysteresis", "slack")]
    return Table(columns, joints)


_STILL_SPEED = 1e-3  # RMS [rad/s, m/s] below which a joint stands still
_ROUNDING_SHARE = 1e-9  # relative rounding error of offsets summed in different orders


def check_file(
    source: str,
    reading: Reading | None = None,
    *,
    robot: str | None = None,
    max_error: tuple[float, ...] | None = None,
    typed: tuple[str, ...] = (),
) -> FileReport:
    """Check a file (or catalogue name) by its kind.

    Args:
        source, reading: Path or name, and a recording's mapping and corrections.
        robot, max_error: As in `check_recording`.
        typed: Options to repeat in the suggested next command.
    """
    path = Path(source)
    reading = reading if reading is not None else Reading()
    as_read = replace(reading, mend=NO_MEND)
    as_typed = TypedRecording(source, typed)
    if reading.mapping is not None:
        log = read_recording(path, as_read)
        return check_recording(log, as_typed, mend=reading.mend, robot=robot, max_error=max_error)
    if source in robot_names():
        return check_robot(load_robot(source))
    is_recording = bags_in(path) != [path] or is_journal(path) or (path / METADATA).is_file()
    if needs_mapping(path) or (format_of(path).holds == "messages" and (is_recording or not path.is_dir())):
        return _check_third_party(source, reading.mend, robot, max_error)
    if path.is_dir():
        hint = "; of a project `catenary view` shows the results" if (path / SETTINGS).is_file() else ""
        raise FileFormatError(f"{path}: is a folder, expected a file or a bag{hint}")
    if format_named(path).holds == "robot":
        return check_robot(load_robot(source))
    # models are recognised by content, recordings by the file's ending
    arrays = read_arrays(path).keys() if path.is_file() and is_zipfile(path) else set[str]()
    if "structure" in arrays:
        if "combination" in arrays:
            return _with_card(_check_identification, path, *load_identification(path))
        return _with_card(_check_model, path, *load_model(path))
    if "q" in arrays and "q_des" not in arrays and {"tau", "effort"} & arrays:
        if robot is None:
            raise InputError(
                f"{path}: is a recording for identification, positions and torques without names or units: "
                "of which robot? name it with --robot"
            )
        model = load_robot(robot)
        log = read_torque_log(path, model, reading)
        report = recording_report("recording for identification", log, model)
        report.faults, remarks, report.findings = torque_verdict(log, model)
        report.remarks = [*log.notes, *remarks]
        report.next = "" if report.faults else as_typed.command("identify", reading.mend.options, "_arm.npz")
        return report
    if format_of(path).has_layouts:
        try:
            layout = known_layout([path], robot=robot)
        except FileFormatError:  # reading the file raises a more detailed error
            layout = ""
        if layout is None and "q_des" not in arrays:
            return _check_third_party(source, reading.mend, robot, max_error)
        log = read_recording(path, as_read)
        return check_recording(log, as_typed, mend=reading.mend, robot=robot, max_error=max_error, layout=layout or "")
    if not path.exists():
        raise FileFormatError(f"{source}: no such file, and no robot of that name; robots: {', '.join(robot_names())}")
    raise FileFormatError(
        f'{source}: ending "{path.suffix}" is not one that catenary reads: robots ({", ".join(endings("robot"))}), '
        "models (.npz), recordings (bags, .npz, .parquet, .csv; of others `catenary import FILE` proposes a mapping)"
    )


def _check_third_party(source: str, mend: Mend, robot: str | None, max_error: tuple[float, ...] | None) -> FileReport:
    """Check a third-party recording, imported by its known layout or by a proposed mapping."""
    path = Path(source)
    units = next((text for text in mend.units if units_of(text)[0] is None), None)
    mend = replace(mend, units=tuple(text for text in mend.units if text != units))
    options = [*(("--units", units) if units else ()), *(("--robot", robot) if robot else ())]
    layout = known_layout([path], robot=robot)
    if layout is None:
        proposal = propose_mapping(path, units=units, robot=robot)
        if proposal.questions and "[q_nominal]" not in proposal.toml:
            with suppress(CatenaryError):
                return _check_inertial(source)
        if proposal.questions:
            facts = {"proposal": proposal.toml, "decisions": list(proposal.decisions)}
            toml = f"{path.with_suffix('').name}.toml"
            asks = shlex.join(["catenary", "import", source, *options]) + f" > {shlex.quote(toml)}"
            return FileReport(
                "third-party recording", facts, [], [f"open: {question}" for question in proposal.questions],
                next=f"{asks}, answer what is OPEN in it, then catenary check {shlex.quote(source)} --mapping {toml}",
            )  # fmt: skip
        log, options = import_recording(path, proposal.accepted()), [*options, "--yes"]
    else:
        log = import_recording(path, units=units, robot=robot)
    as_typed = TypedRecording(source, () if robot is None else ("--robot", robot), tuple(options))
    return check_recording(
        log, as_typed, mend=mend, robot=robot, max_error=max_error, layout=layout or "by the mapping that it suggests"
    )


def _check_inertial(source: str) -> FileReport:
    imu = read_imu(Path(source))
    report = FileReport("recording of an inertial unit", next=shlex.join(["catenary", "sense", "--replay", source]))
    report.add("readings", len(imu.time), f"{len(imu.time)} in {imu.duration:.1f} s")
    report.add("gyroscope", imu.rate is not None, "none" if imu.rate is None else "yes")
    finite = np.asarray(np.isfinite(imu.force).all(axis=1))
    if not finite.all():
        report.faults.append(f"{int((~finite).sum())} of {len(finite)} accelerometer readings are not numbers")
    mean = imu.force[finite].mean(axis=0) if finite.any() else np.full(3, np.nan)
    report.add("mean_force", mean.tolist(), f"{', '.join(f'{f:.2f}' for f in mean)} m/s2", called="mean")
    report.remarks += imu.notes
    return report


def check_robot(model: RobotModel) -> FileReport:
    """Check a robot: inertia, implausible masses, limits, and parts of its file that the model lacks."""
    report = FileReport("robot")
    joints, limits = [], []
    ends = model.lower.tolist(), model.upper.tolist()
    for name, unit, lower, upper in zip(model.joint_names, model.joint_units, *ends, strict=True):
        joints.append({"name": name, "unit": unit, "lower": lower, "upper": upper})
        shown, scale = DISPLAY[unit]
        bounds = f"{scale * lower:g} to {scale * upper:g} {shown}" if np.isfinite([lower, upper]).any() else "no limits"
        limits.append(f"{name} [{unit}] {bounds}")
    mass, drives = float(model.tree.mass.sum()), _drives(model)
    report.add("name", model.name)
    report.add("joints", joints, "; ".join(limits))
    report.add("links", model.link_names, ", ".join(model.link_names))
    report.add("frames", list(model.frames), ", ".join(model.frames))
    report.add("tip", model.tip)
    report.add("moving_mass_kg", mass, f"{mass:g} kg", called="moving mass")
    report.add("massless_links", model.massless, ", ".join(model.massless) or "none")
    driven = []
    for drive in drives or ():
        force, inertia = ("Nm", "kg m2") if drive["unit"] == "rad" else ("N", "kg")
        friction = f"{drive['coulomb']:.4g} {force} + {drive['viscous']:.4g} {force} s/{drive['unit']}"
        driven.append(f"{drive['joint']} friction {friction}, rotor {drive['rotor']:.4g} {inertia}")
    report.add("drives", drives, "; ".join(driven) or "nothing known of friction and rotors")
    report.add("sources", model.sources, "; ".join(model.sources) or "none stated")
    report.facts["links_without_inertia"] = model.missing_inertia
    if model.missing_inertia == model.link_names:  # no link has any, as in catalogue robots with kinematics only
        to_be_identified = ", to be identified (catenary identify)" if model.actuation is not None else ""
        report.remarks.append(f"has no inertia{to_be_identified}: kinematics work, gravity and torques are refused")
    elif model.missing_inertia:
        report.faults.append(
            f"no inertia for {', '.join(model.missing_inertia)}: kinematics work, gravity and torques are refused"
        )
    unbound = [name for name, is_so in zip(model.joint_names, model.lower >= model.upper, strict=True) if is_so]
    report.faults += [*model.doubts, *mass_doubts(model)]
    report.faults += [f"limits of {name}: the lower one is not below the upper" for name in unbound]
    report.remarks += model.notes
    return report


def _drives(model: RobotModel) -> list[dict[str, Any]] | None:
    """Return friction and rotor of every joint, SI; None if unknown."""
    drives = None if model.actuation is None else joint_drives(model.actuation, model.n)
    if drives is None:
        return None
    numbers = zip(model.joint_names, model.joint_units, *(column.tolist() for column in drives[:3]), strict=True)
    return [dict(zip(("joint", "unit", "coulomb", "viscous", "rotor"), row, strict=True)) for row in numbers]


def torque_verdict(log: MotionLog, model: RobotModel) -> tuple[list[str], list[str], tuple[Finding, ...]]:
    """Return faults, remarks and findings about a recording for identification.

    It is fitted as by `identify --free --friction none`, to full dynamics, or to gravity if it has no time.
    """
    terms = "static" if log.time is None else "full"
    options = IdentifyOptions(terms=terms, consistent=False, friction=())  # type: ignore[arg-type]  # one of the two
    findings = (*stamp_findings(log), *(finding for _, finding in repeated_findings([log])))
    faults, remarks = list[str](), list[str]()
    result: Identification | None = None
    try:
        samples = prepare(log, model, options, within_limits=False)
        findings = (*findings, *explained_torques(model, samples)[0])
        check_positions(log, model)
        speed = np.sqrt(np.mean(samples.qd**2, axis=0))
        still = [name for name, v in zip(model.joint_names, speed, strict=True) if v < _STILL_SPEED and terms == "full"]
        remarks += [*samples.notes, *[f"stands still: {', '.join(still)}"] * bool(still)]
        result = identify_samples([samples], model, options)
    except (InputError, ExcitationError) as error:
        faults = [str(error)]
    faults = [*(f"{finding.name}: {finding}" for finding in findings if finding.refuses), *faults]
    remarks = [*(f"{finding.name}: {finding}" for finding in findings if not finding.refuses), *remarks]
    if result is None:
        return faults, remarks, findings
    residuals = zip(model.joint_names, result.training[0].relative_rms, strict=True)
    parameters = f"all {result.base.count} base parameters ({terms}), condition {result.condition:.3g}"
    remarks += [
        f"for identification: shows {parameters}",
        "relative residual (RMS) of a fit to it alone, with Coulomb and viscous friction: "
        + ", ".join(f"{name} {share:.3f}" for name, share in residuals),
    ]
    return faults, remarks, findings


def _with_card(report_of: Callable[[Path, Any, Card], FileReport], path: Path, content: Any, card: Card) -> FileReport:
    """Return the report of a file with a card; errors from unexpected contents of the card mean a damaged file."""
    try:
        return report_of(path, content, card)
    except CatenaryError:
        raise
    except (TypeError, LookupError, AttributeError, ValueError) as error:
        raise FileFormatError(f"{path}: damaged: its card is not one that catenary writes ({error})") from error


def _check_identification(path: Path, result: Identification, card: Card) -> FileReport:
    report = FileReport("identified dynamics")
    recordings, lines = [], []
    for part, tested in (("training", result.training), ("test", result.tests)):
        for on in tested:
            relative = dict(zip(result.model.joint_names, map(float, on.relative_rms), strict=True))
            recordings.append({"name": on.log, "part": part, "verdict": on.verdict, "relative_rms": relative})
            shares = ", ".join(f"{share:.3f}" for share in relative.values())
            lines.append((f"{on.log}, {on.verdict or 'fitted'}", shares))
    report.add("robot", result.model.name)
    report.add("terms", result.options.terms)
    report.add("base_parameters", result.base.count, f"{result.base.count}, condition {result.condition:.4g}")
    report.add("physically_consistent", result.phi is not None, "yes" if result.phi is not None else "no")
    report.facts |= {"condition": float(result.condition), "recordings": recordings}
    report.lines += lines
    report.add("version", card["version"], ", ".join(f"{name} {number}" for name, number in card["version"].items()))
    report.faults += _copy_faults(path, card)
    report.faults += [f"fails on {one.log}" for one in result.tests if one.verdict == "fails"]
    report.faults += mass_doubts(result.robot(), described=result.model) if result.phi is not None else []
    report.remarks += card["notes"]
    return report


def _copy_faults(path: Path, card: Card) -> list[str]:
    """Return a fault if a card's readable copy exists and differs."""
    copy = card_path(path)
    if not copy.is_file() or copy.read_bytes() == card_text(card).encode():
        return []
    return [f"{copy}: differs from the card in {path.name}, which counts: another file's, or edited; delete it"]


def _check_model(path: Path, model: CalibrationModel, card: Card) -> FileReport:
    blocks = {one["joint"]: one for one in (card["errors"]["cross_validation"] or {"joints": []})["joints"]}
    last = {one["name"]: one for one in card["errors"]["held_out"] or []}
    report, joints = FileReport("calibration model"), list[Mapping[str, Any]]()
    on_blocks, on_last = list[Line](), list[Line]()
    report.faults += _copy_faults(path, card)
    for name, unit in zip(model.joint_names, model.joint_units, strict=True):
        shown = DISPLAY[unit][0]
        joint: dict[str, Any] = {"name": name, "unit": unit, "error_unit": shown}
        joint |= {"cross_validation": None, "held_out": None}
        if (one := blocks.get(name)) is not None:
            rmse, sd, offset = one["rmse_mean"], one["rmse_sd"], one["offset_rmse_mean"]
            joint["cross_validation"] = {"rmse": rmse, "rmse_sd": sd, "offset_rmse": offset}
            spread = f"RMSE {rmse:.3f} ± {sd:.3f} {shown} on unseen data"
            on_blocks.append((name, f"{spread} (fixed offset {offset:.3f})"))
            if rmse > offset * (1.0 + _ROUNDING_SHARE):
                report.faults.append(f"{name}: worse than the fixed offset on unseen data")
        if (one := last.get(name)) is not None:
            joint["held_out"] = {"rmse": one["rmse"], "offset_rmse": one["offset_rmse"]}
            error = f"RMSE {one['rmse']:.3f} {shown} on the last part of the recordings, which it did not see"
            on_last.append((f"{name}, held out", f"{error} (fixed offset {one['offset_rmse']:.3f})"))
        joints.append(joint)
    report.facts |= {
        "model": model.kind, "preset": model.preset, "target": model.target, "joints": joints,
        "inputs": model.features.names, "delay_s": clock_delay(card), "seed": card["run"]["seed"],
        "fitted_to": [{"name": one["name"], "sha256": one["sha256"]} for one in card["data"]],
        **{key: card.get(key) for key in ("robot", "instrument", "tool", "recorded", "simulated", "rows", "version")},
    }  # fmt: skip
    simulated = "yes: fitted to simulated recordings" if card["simulated"] else "no"
    report.lines += [("kind", model_name(model)), ("robot", card["robot"] or "not stated"), ("simulated", simulated)]
    report.lines += [("joints", joints_text(model)), *card_facts(card)]
    report.lines += [*on_blocks, *on_last]
    report.remarks += card["notes"]
    return report
