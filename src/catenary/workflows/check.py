"""Report what a file is and what is wrong with it: robot, calibration model, or recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import numpy as np

from catenary.archives import read_arrays
from catenary.arrays import Floats
from catenary.calibration.card_schema import check_card
from catenary.calibration.files import load_model
from catenary.calibration.model import CalibrationModel
from catenary.errors import FileFormatError
from catenary.identification.files import load_identification
from catenary.plant import MotionLog
from catenary.recording.foreign.read import Reading, read_recording
from catenary.recording.table_kind import table_ending
from catenary.reports.calibration import shortened
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.units import DISPLAY
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.finding import Finding

ROBOT_ENDINGS = (".toml", ".urdf", ".xml", ".mjcf")
LONG_GAP = 10.0  # times the median step between stamps


@dataclass
class FileReport:
    """Kind, facts and faults of a file."""

    kind: str  # "robot", "calibration model", "identified dynamics" or "recording"
    facts: list[tuple[str, str]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)  # make it unfit for its use, or its numbers doubtful
    remarks: list[str] = field(default_factory=list)  # worth knowing
    findings: tuple[Finding, ...] = ()  # about a recording; in words they are faults, or remarks

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "kind": self.kind,
            "facts": dict(self.facts),
            "faults": self.faults,
            "remarks": self.remarks,
            "findings": [finding.as_data() for finding in self.findings],
        }


def check_file(source: str, reading: Reading | None = None, *, robot: str | None = None) -> FileReport:
    """Find out what a file (or a catalogue name) is, and what is wrong with it.

    Args:
        source: A file, or a robot's name in the catalogue.
        reading: What a recording does not say of itself, and how it is mended.
        robot: Catalogue name or file of the robot that a recording is of; its own when None.

    Raises:
        FileFormatError: No such file, unknown kind, or it cannot be read at all; the message says why.
        InputError: A recording or robot whose numbers cannot be used; the message says which.
    """
    path = Path(source)
    if reading is not None and reading.mapping is not None:
        return check_recording(read_recording(path, reading), robot=robot)
    if source in robot_names():
        return check_robot(load_robot(source))
    if path.is_dir():
        raise FileFormatError(f"{path}: is a folder, expected a file")
    if path.suffix.lower() in ROBOT_ENDINGS:
        return check_robot(load_robot(source))
    # a model may have any name; a recording's says what it is
    if path.is_file() and is_zipfile(path) and "structure" in (arrays := read_arrays(path)):
        return _check_identification(path) if "combination" in arrays else _check_model(path)
    if table_ending(path) in (".npz", ".parquet", ".csv"):
        return check_recording(read_recording(path, reading), robot=robot)
    if not path.exists():
        raise FileFormatError(
            f"{source}: no such file, and no robot of that name; robots: {', '.join(robot_names())}"
        )
    raise FileFormatError(
        f'{source}: ending "{path.suffix}" is not one that catenary reads: robots ({", ".join(ROBOT_ENDINGS)}), '
        "models (.npz), recordings (.npz, .parquet, .csv; of others `catenary import FILE` proposes a mapping)"
    )


def check_robot(model: RobotModel) -> FileReport:
    """Check a robot: inertia, limits, what its file holds that the model leaves out."""
    finding = FileReport("robot")
    joints = []
    ranges = list(zip(model.joint_names, model.joint_units, model.lower, model.upper, strict=True))
    for name, unit, low, high in ranges:
        shown, scale = DISPLAY[unit]
        free = np.isinf(low) and np.isinf(high)
        limits = "no limits" if free else f"{scale * low:g} to {scale * high:g} {shown}"
        joints.append(f"{name} [{unit}] {limits}")
    finding.facts = [
        ("name", model.name),
        ("joints", "; ".join(joints)),
        ("links", ", ".join(model.link_names)),
        ("frames", ", ".join(model.frames)),
        ("tip", model.tip),
        ("moving mass", f"{model.tree.mass.sum():g} kg"),
        ("massless links", ", ".join(model.massless) or "none"),
        ("sources", "; ".join(model.sources) or "none stated"),
    ]
    if model.actuation is not None and model.missing_inertia == model.link_names:
        # a table that states friction and filters but no inertia at all is there to be identified
        finding.remarks.append(
            "kinematics only, to be identified (catenary identify): torques and masses are refused until then"
        )
    elif model.missing_inertia:
        finding.faults.append(
            f"no inertia for {', '.join(model.missing_inertia)}: kinematics work, torques and masses are refused"
        )
    finding.faults += list(model.doubts)
    unbound = [name for name, _, low, high in ranges if low >= high]
    finding.faults += [f"limits of {name}: the lower one is not below the upper" for name in unbound]
    finding.remarks += list(model.notes)
    return finding


def check_recording(log: MotionLog, *, robot: str | None = None) -> FileReport:
    """Check a recording: rows, rate, gaps, joints, errors, and the verdict that a fit begins with."""
    finding = FileReport("recording")
    finding.facts = [
        ("rows", f"{len(log):,}, {int(log.ok.sum()):,} with a trusted measurement"),
        ("joints", _joints(log)),
        ("robot", log.robot or "not stated"),
        ("simulated", "yes" if log.simulated else "not said"),
        ("sha256", log.sha256 or "unknown"),
    ]
    if log.time is not None:
        _check_time(finding, log.time)
    for j, (name, unit) in enumerate(zip(log.joint_names, log.joint_units, strict=True)):
        shown, scale = DISPLAY[unit]
        q = scale * log.q_nominal[:, j]
        fact = f"{q.min():.2f} to {q.max():.2f} {shown}"
        if log.q_encoder is not None and log.ok.any():
            error = scale * (log.q_encoder - log.q_nominal)[log.ok, j]
            fact += f", error RMS {np.sqrt(np.mean(error**2)):.3f}, largest {np.abs(error).max():.2f} {shown}"
        finding.facts.append((name, fact))
    if log.q_encoder is None:
        finding.faults.append("no measured joint positions (q_encoder): it cannot be calibrated from")
    elif log.ok.any() and not log.ok.all():
        finding.remarks.append(f"{(~log.ok).sum()} rows without a trusted measurement serve as history only")
    finding.remarks += log.notes
    finding.findings = findings_of(log, robot=robot_of([log], robot))
    for found in finding.findings:
        (finding.faults if found.refuses else finding.remarks).append(f"{found.name}: {found}")
    return finding


def _check_time(finding: FileReport, time: Floats) -> None:
    steps = np.diff(time)
    forward = steps[steps > 0.0]
    if len(forward):
        median = float(np.median(forward))
        finding.facts.append(("duration", f"{forward.sum():.1f} s, median step {median:.4g} s"))
        gaps = int((forward > LONG_GAP * median).sum())
        if gaps:
            finding.remarks.append(
                f"{gaps} gaps longer than {LONG_GAP:g} median steps, the longest {forward.max():.3g} s"
            )


def _check_identification(path: Path) -> FileReport:
    result, card = load_identification(path)
    finding = FileReport("identified dynamics")
    finding.facts = [
        ("robot", result.model.name),
        ("terms", result.options.terms),
        ("base parameters", f"{result.base.count}, condition {result.condition:.4g}"),
        ("physically consistent", "no" if result.phi is None else "yes"),
        *(
            (f"{r.log}, {r.verdict or 'fitted'}", ", ".join(f"{v:.3f}" for v in r.relative_rms))
            for r in (*result.training, *result.tests)
        ),
        _version(card),
    ]
    finding.faults = [f"fails on {r.log}" for r in result.tests if r.verdict == "fails"]
    finding.remarks = list(card["notes"])
    return finding


def _check_model(path: Path) -> FileReport:
    model, card = load_model(path)
    check_card(card, str(path))
    finding = FileReport("calibration model")
    finding.facts = [
        ("kind", model.kind + (f", preset {model.preset}" if model.preset else "")),
        ("robot", card["robot"] or "not stated"),
        ("simulated", "yes: fitted to simulated recordings" if card["simulated"] else "no"),
        ("joints", _joints(model)),
        ("inputs", f"{len(model.features.names)}: {shortened(model.features.names)}"),
        ("target", model.target),
        ("fitted to", ", ".join(f"{s['name']} (sha256 {str(s['sha256'])[:12]})" for s in card["data"])),
        ("rows", str(card["rows"])),
        ("seed", str(card["run"]["seed"])),
        _version(card),
    ]
    for joint in (card["errors"]["cross_validation"] or {"joints": []})["joints"]:
        spread = (
            f"RMSE {joint['rmse_mean']:.3f} ± {joint['rmse_sd']:.3f} {joint['unit']} on unseen blocks of time"
        )
        finding.facts.append((joint["joint"], f"{spread} (fixed offset {joint['offset_rmse_mean']:.3f})"))
        # two ways to sum the same offset differ in their last digits
        if joint["rmse_mean"] > joint["offset_rmse_mean"] * (1.0 + 1e-9):
            finding.faults.append(f"{joint['joint']}: worse than the fixed offset on unseen blocks of time")
    for joint in card["errors"]["held_out"] or []:
        error = f"RMSE {joint['rmse']:.3f} {joint['unit']} on the last part of the recordings, which it did not see"
        fact = f"{joint['name']}, held out", f"{error} (fixed offset {joint['offset_rmse']:.3f})"
        finding.facts.append(fact)
    finding.remarks = list(card["notes"])
    return finding


def _joints(of: MotionLog | CalibrationModel) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in zip(of.joint_names, of.joint_units, strict=True))


def _version(card: Mapping[str, Any]) -> tuple[str, str]:
    return "version", ", ".join(f"{name} {number}" for name, number in card["version"].items())
