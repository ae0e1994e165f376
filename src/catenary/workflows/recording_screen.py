"""What check says of a file on one screen: kind, facts, faults and the command to use next; all that of a recording."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.calibration.dataset import date_of, error_limits
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.mend import NOTHING, Mend, retimed_by
from catenary.reports.model_figure import overlay
from catenary.reports.page import Column, Table
from catenary.robots.model import RobotModel
from catenary.units import DISPLAY
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.finding import Finding
from catenary.verdict.hysteresis import hysteresis_of
from catenary.verdict.pairs import OUTLIER_SPREADS, outliers

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FORMAT = "catenary.check.1"  # of what --json prints
ROWS = 18  # of a screen of 24, that facts, joints, faults and remarks of two rows share
LONGEST = 170  # letters of a remark on it
Line = tuple[str, str]  # what a fact is called, and what it says
SOUND = "nothing wrong found"
DOUBTS = ("jump", "drift", "filled", "missing", "units")  # notes by which errors are those of something else


@dataclass
class FileReport:
    """Kind, facts and faults of a file."""

    kind: str  # "robot", "calibration model", "identified dynamics" or a recording
    facts: dict[str, Any] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)  # the facts as people read them
    faults: list[str] = field(default_factory=list)  # make it unfit for its use, or its numbers doubtful
    remarks: list[str] = field(default_factory=list)  # worth knowing
    findings: tuple[Finding, ...] = ()  # about a recording; in words they are faults, or remarks
    joints: Table | None = None  # of a recording
    sound: str = SOUND  # the verdict where there is no fault
    draw: "Callable[[], Figure] | None" = None  # a recording's delay
    next: str = ""  # the command line to use next, or what else to do

    def tell(self, key: str, fact: Any, text: str | None = None, *, called: str = "") -> None:
        """Add a fact, and its line in words: the fact itself where it is a text."""
        self.facts[key] = fact
        self.lines.append((called or key.replace("_", " "), str(fact) if text is None else text))

    @property
    def verdict(self) -> str:
        """What it comes to, in a sentence."""
        if self.faults:
            return f"{len(self.faults)} fault(s) found"
        doubted = [" of ".join(filter(None, (x.name, ", ".join(x.joints)))) for x in self.findings if x.name in DOUBTS]
        return f"in doubt: {', '.join(doubted)}; otherwise {self.sound}" if doubted else self.sound

    @property
    def shown_remarks(self) -> list[str]:
        """What a screen has room for; findings that have a line among the facts are not repeated."""
        if self.joints is None:
            return self.remarks
        told = ("units not stated", *(f"{name}: " for name, _ in self.lines))
        remarks = [shorten(each, LONGEST, placeholder=" ...") for each in self.remarks if not each.startswith(told)]
        room = ROWS - len(self.lines) - len(self.joints.records) - 2 * len(self.faults)
        most = max(1, room // 2 - 1)
        more = len(remarks) - most
        return [*remarks[:most], *[f"{more} more, and all of these whole: --json"] * (more > 0)]

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        told = {key: getattr(self, key) for key in ("kind", "facts", "faults", "remarks")}
        findings = [asdict(finding) for finding in self.findings]
        return {"format": FORMAT, **told, "findings": findings, "verdict": self.verdict, "next": self.next}


LONG_GAP = 10.0  # times the median step between stamps
FEW_REVERSALS = 6  # of a joint: its slack and hysteresis are hardly shown
ROUNDS = 4  # of mends: one fault may hide another
MAX_ERROR = "--max-error"
Limits = tuple[float, ...] | None


@dataclass(frozen=True)
class TypedRecording:
    """A recording as it was typed, of which the command to use next is made."""

    name: str  # of the file or folder
    options: tuple[str, ...] = ()  # that say how it is read: its mapping, its robot
    imports: tuple[str, ...] | None = None  # options of the import that it needs first; None where it needs none

    def command(self, verb: str, options: Sequence[str], written: str) -> str:
        """Return the command line that uses it, and writes a file of its name and `written`."""
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
    mend: Mend = NOTHING,
    robot: str | None = None,
    max_error: Limits = None,
    layout: str = "",
) -> FileReport:
    """Check a recording for calibration, as it was read; the mends that its next command has were tried on it.
    `source` is where it was read from, a motion log of its name when None; `robot` a name or file, its own when None.
    Rows beyond `max_error`, per joint in deg and mm, are left out.
    """
    source = source if source is not None else TypedRecording(f"{log.name}.parquet")
    as_read, log = log, mend(log)
    arm = robot_of([log], robot)
    findings = findings_of(log, robot=arm, max_error=error_limits(max_error, log))
    mended, cured, limits, left = _cured(as_read, mend, findings, arm, max_error)
    found = recording_report("recording", log, arm, cured)
    found.lines[0] = ("recording", f"{layout}{', ' if layout else ''}{found.lines[0][1]}")
    found.findings = findings
    found.remarks = [f"{each.name}: {each}" for each in findings if not each.refuses]
    few = [f"{j['name']} {j['reversals']} times" for j in found.facts["joints"] if 0 < j["reversals"] < FEW_REVERSALS]
    found.remarks += [f"few reversals ({', '.join(few)}): they hardly show slack and hysteresis"] * bool(few)
    lost = int((~log.ok).sum())
    if log.q_encoder is None:
        found.faults.append("no measured joint positions (q_encoder): it cannot be calibrated from")
        robot_of_it = [] if "--robot" in source.options else ["--robot", log.robot or "ROBOT"]
        found.next = "measure the joints by a camera or encoders, and import that too: --map q_encoder=COLUMNS"
        found.next = found.next if log.tau is None else source.command("identify", robot_of_it, "_arm.npz")
    else:
        found.next = (
            f"no option corrects {', '.join(left)}: bring in the right columns (catenary import), or record again"
            if left
            else source.command("fit", [*mended.options, *([MAX_ERROR, limits] if limits else [])], "_model.npz")
        )
        found.remarks += [f"{lost} rows without a trusted measurement serve as history only"] * (0 < lost < len(log))
    found.remarks += [note for note in log.notes if not note.endswith("have no q_encoder")]
    found.faults += [f"{each.name}: {each}" for each in findings if each.refuses]
    _tell(found, findings)
    if log.q_encoder is not None:
        delay = found.facts["delay"] or {}
        before, shift = retimed_by(log), delay["seconds"] if delay.get("sure") in ("certain", "likely") else 0.0
        found.draw = lambda: overlay(log, before, -shift)
    return found


def _tell(found: FileReport, findings: Sequence[Finding]) -> None:
    """Give delay and outliers lines and facts of their own, and say in the verdict what could hide."""
    delay = next((each.delay for each in findings if each.delay is not None), None)
    found.facts["delay"] = None if delay is None else asdict(delay)
    found.lines += [("delay", each.says) for each in findings if each.name == "delay"]
    measured = found.facts["measured_rows"]
    wild = ", ".join(f"{j['name']} {j['outliers']}" for j in found.facts["joints"] if j["outliers"])
    told = f"{wild} of {measured:,} rows, beyond {OUTLIER_SPREADS:g} robust standard deviations" if wild else "none"
    found.lines += [("outliers", told)] * bool(measured)
    if delay is not None and delay.sure != "certain":
        found.sound += f"; a delay within {delay.low:+.3f} to {delay.high:+.3f} {delay.unit} would hide"


def _cured(
    log: MotionLog, mend: Mend, findings: Sequence[Finding], robot: RobotModel | None, max_error: Limits
) -> tuple[Mend, MotionLog, str, list[str]]:
    """Follow what findings advise until none refuses.

    Return the mend, the log so mended, the text of --max-error, and names of findings that no option corrects.
    """
    limits = "" if max_error is None else ",".join(f"{limit:g}" for limit in max_error)
    for _ in range(ROUNDS):
        wrong = [each for each in findings if each.refuses]
        asked = [each.remedy for each in findings if each.remedy.startswith(f"{MAX_ERROR} ")]
        limits = asked[0].removeprefix(f"{MAX_ERROR} ") if asked and not limits and not wrong[1:] else limits
        more = mend
        for each in wrong:
            more = more.and_then(each.remedy) or more
        names = [each.name for each in wrong if each.remedy not in asked]
        if not names or more == mend:
            return mend, mend(log), limits, list(dict.fromkeys(names))
        try:
            mended = more(log)
            within = error_limits(None if not limits else tuple(map(float, limits.split(","))), log)
            mend, findings = more, findings_of(mended, robot=robot, max_error=within)
        except InputError:  # such as a shift that leaves no row
            break
    return mend, mend(log), limits, [each.name for each in findings if each.refuses]


def recording_report(
    kind: str, log: MotionLog, robot: RobotModel | None = None, cured: MotionLog | None = None
) -> FileReport:
    """Return what a recording holds, before anything is said of it.

    Joints are compared with the robot's limits; slack and hysteresis are looked for in `cured`, the same recording with
    every fault mended that can be.
    """
    found = FileReport(kind, dict.fromkeys(("duration_s", "median_step_s", "gaps", "longest_gap_s")))
    measured = int(log.ok.sum()) if log.q_encoder is not None else 0
    began, units = log.began + (0.0 if log.time is None else float(log.time[0])), _units(log)
    found.facts |= {key: getattr(log, key) for key in ("name", "robot", "simulated", "sha256")}
    found.facts |= {"rows": len(log), "measured_rows": measured, "recorded": date_of(began), "units_from": units}
    rows = f"{len(log):,} rows, {f'{measured:,}' if measured else 'none'} with a trusted measurement"
    of = f"{log.robot or 'not stated'}{', simulated' if log.simulated else ''}"
    found.lines += [("recording", rows), ("robot", f"{of}; {date_of(began) or 'date not stated'}")]
    steps = np.diff(np.empty(0) if log.time is None else log.time)
    if len(forward := steps[steps > 0.0]):
        duration, median = float(forward.sum()), float(np.median(forward))
        gaps, longest = int((forward > LONG_GAP * median).sum()), float(forward.max())
        found.facts |= {"median_step_s": median, "gaps": gaps, "longest_gap_s": longest if gaps else None}
        long = f"{gaps} gaps longer than {LONG_GAP:g} steps, the longest {longest:.3g} s" if gaps else "no gaps"
        told = f"{duration:.1f} s, median step {median:.4g} s ({1.0 / median:.4g} Hz), {long}"
        found.tell("duration_s", duration, told, called="duration")
    found.lines.append(("units", f"{', '.join(log.joint_units)}: {units}"))
    found.facts["joints"] = _joints(log, robot, log if cured is None else cured)
    found.joints = _table(found.facts["joints"], measured=log.q_encoder is not None)
    return found


def _units(log: MotionLog) -> str:
    """Return where a recording's units come from."""
    given = [text for key, texts in log.settled.items() if key.startswith("units") for text in texts]
    if given:
        return f"made of what --units says ({'; '.join(given)})"
    if log.units_assumed:
        return "assumed, as nobody states them"
    return "as its file or its mapping states" if "units" in log.settled else "as --robot or --units says"


def _joints(log: MotionLog, robot: RobotModel | None, cured: MotionLog) -> list[dict[str, Any]]:
    """Return what each joint covers and how far off it is, in its own unit, errors in deg and mm."""
    told = []
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
        told.append(joint | {key: float(x) if np.isfinite(x) else None for key, x in widths.items()})
    return told


def _table(joints: Sequence[dict[str, Any]], *, measured: bool) -> Table:
    def reach(j: dict[str, Any]) -> str:
        low, high = (DISPLAY[j["unit"]][1] * j[key] for key in ("lowest", "highest"))
        return f"{low:.2f} to {high:.2f} {j['error_unit']}"

    columns: list[Column] = [("joint", "name"), ("range", reach), ("of limits", "share_of_limits:.0f %"), "reversals"]
    if measured:
        columns += [("error RMS", "error_rms:.3f"), ("largest", "error_largest:.2f")]
        columns += [(width, f"{width}:.2f") for width in ("hysteresis", "slack")]
    return Table(columns, joints)
