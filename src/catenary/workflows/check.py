"""Report what a file is and what is wrong with it: robot, calibration model, or recording."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import numpy as np

from catenary.archives import read_arrays
from catenary.calibration.dataset import error_limits
from catenary.calibration.model import Card
from catenary.calibration.model_file import load_model
from catenary.errors import FileFormatError, InputError
from catenary.files import card_path, card_text, table_ending
from catenary.identification.identification import Identification
from catenary.identification.identification_file import load_identification
from catenary.identification.residuals import LogResidual
from catenary.plant import MotionLog
from catenary.recording.logs import Reading, read_recording, read_torque_recording
from catenary.reports.file_facts import (
    DynamicsFacts,
    FileFacts,
    FittedTo,
    HeldOutErrors,
    JointLimits,
    JointRange,
    ModelFacts,
    ModelJoint,
    Part,
    RecordingFacts,
    RobotFacts,
    TorqueErrors,
    UnseenErrors,
)
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.units import DISPLAY
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.finding import Finding
from catenary.workflows.check_torques import holds_torques, torque_verdict

ROBOT_ENDINGS = (".toml", ".urdf", ".xml", ".mjcf")
FORMAT = "catenary.check.1"  # of what --json prints
LONG_GAP = 10.0  # times the median step between stamps


@dataclass
class FileReport:
    """Kind, facts and faults of a file."""

    kind: str  # "robot", "calibration model", "identified dynamics" or a recording
    facts: FileFacts
    faults: list[str] = field(default_factory=list)  # make it unfit for its use, or its numbers doubtful
    remarks: list[str] = field(default_factory=list)  # worth knowing
    findings: tuple[Finding, ...] = ()  # about a recording; in words they are faults, or remarks

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "format": FORMAT,
            "kind": self.kind,
            "facts": self.facts.as_data(),
            "faults": self.faults,
            "remarks": self.remarks,
            "findings": [asdict(finding) for finding in self.findings],
        }


def check_file(
    source: str, reading: Reading | None = None, *, robot: str | None = None, max_error: tuple[float, ...] | None = None
) -> FileReport:
    """Find out what a file (or a catalogue name) is, and what is wrong with it.

    Args:
        source: A file, or a robot's name in the catalogue.
        reading: What a recording does not say of itself, and how it is mended.
        robot: Catalogue name or file of the robot that a recording is of; its own when None.
        max_error: Per joint, deg and mm; rows of a recording with larger errors are left out.

    Raises:
        FileFormatError: No such file, unknown kind, or it cannot be read at all; the message says why.
        InputError: A recording or robot whose numbers cannot be used; the message says which.
    """
    path = Path(source)
    if reading is not None and reading.mapping is not None:
        return check_recording(read_recording(path, reading), robot=robot, max_error=max_error)
    if source in robot_names():
        return check_robot(load_robot(source))
    if path.is_dir():
        raise FileFormatError(f"{path}: is a folder, expected a file")
    if path.suffix.lower() in ROBOT_ENDINGS:
        return check_robot(load_robot(source))
    # a model may have any name; a recording's says what it is
    if path.is_file() and is_zipfile(path) and "structure" in (arrays := read_arrays(path)):
        return _check_identification(path) if "combination" in arrays else _check_model(path)
    if path.is_file() and is_zipfile(path) and holds_torques(path):
        if robot is None:
            raise InputError(
                f"{path}: is a recording for identification, positions and torques without names or units: "
                "of which robot? name it with --robot"
            )
        model = load_robot(robot)
        return check_torque_recording(read_torque_recording(path, model, reading), model)
    if table_ending(path) in (".npz", ".parquet", ".csv"):
        return check_recording(read_recording(path, reading), robot=robot, max_error=max_error)
    if not path.exists():
        raise FileFormatError(f"{source}: no such file, and no robot of that name; robots: {', '.join(robot_names())}")
    raise FileFormatError(
        f'{source}: ending "{path.suffix}" is not one that catenary reads: robots ({", ".join(ROBOT_ENDINGS)}), '
        "models (.npz), recordings (.npz, .parquet, .csv; of others `catenary import FILE` proposes a mapping)"
    )


def check_robot(model: RobotModel) -> FileReport:
    """Check a robot: inertia, limits, what its file holds that the model leaves out."""
    limits = zip(model.joint_names, model.joint_units, model.lower, model.upper, strict=True)
    joints = tuple(JointLimits(name, unit, float(low), float(high)) for name, unit, low, high in limits)
    facts = RobotFacts(
        name=model.name,
        joints=joints,
        links=tuple(model.link_names),
        frames=tuple(model.frames),
        tip=model.tip,
        moving_mass_kg=float(model.tree.mass.sum()),
        massless_links=model.massless,
        links_without_inertia=tuple(model.missing_inertia),
        sources=model.sources,
    )
    found = FileReport("robot", facts)
    if model.missing_inertia == model.link_names:  # nobody meant to give any, as of a catalogue's published lengths
        to_be_identified = ", to be identified (catenary identify)" if model.actuation is not None else ""
        found.remarks.append(f"has no inertia{to_be_identified}: kinematics work, gravity and torques are refused")
    elif model.missing_inertia:
        found.faults.append(
            f"no inertia for {', '.join(model.missing_inertia)}: kinematics work, gravity and torques are refused"
        )
    found.faults += list(model.doubts)
    unbound = [joint.name for joint in joints if joint.lower >= joint.upper]
    found.faults += [f"limits of {name}: the lower one is not below the upper" for name in unbound]
    found.remarks += list(model.notes)
    return found


def check_recording(
    log: MotionLog, *, robot: str | None = None, max_error: tuple[float, ...] | None = None
) -> FileReport:
    """Check a recording: rows, rate, gaps, joints, errors, and the verdict that a fit begins with."""
    facts = _recording_facts(log)
    found = FileReport("recording", facts)
    if facts.gaps:
        found.remarks.append(
            f"{facts.gaps} gaps longer than {LONG_GAP:g} median steps, the longest {facts.longest_gap_s:.3g} s"
        )
    if log.q_encoder is None:
        found.faults.append("no measured joint positions (q_encoder): it cannot be calibrated from")
    elif log.ok.any() and not log.ok.all():
        found.remarks.append(f"{(~log.ok).sum()} rows without a trusted measurement serve as history only")
    found.remarks += log.notes
    found.findings = findings_of(log, robot=robot_of([log], robot), max_error=error_limits(max_error, log))
    for finding in found.findings:
        (found.faults if finding.refuses else found.remarks).append(f"{finding.name}: {finding}")
    return found


def check_torque_recording(log: MotionLog, model: RobotModel) -> FileReport:
    """Check a recording for identification: what it shows of its robot, and whether its torques are the motion's."""
    found = FileReport("recording for identification", _recording_facts(log))
    found.faults, remarks, found.findings = torque_verdict(log, model)
    found.remarks = [*log.notes, *remarks]
    return found


def _recording_facts(log: MotionLog) -> RecordingFacts:
    duration = median = gaps = longest = None
    steps = np.diff(np.empty(0) if log.time is None else log.time)
    if len(forward := steps[steps > 0.0]):
        duration, median = float(forward.sum()), float(np.median(forward))
        gaps, longest = int((forward > LONG_GAP * median).sum()), float(forward.max())
    joints = []
    for j, (name, unit) in enumerate(zip(log.joint_names, log.joint_units, strict=True)):
        shown, scale = DISPLAY[unit]
        rms = largest = None
        if log.q_encoder is not None and log.ok.any():
            error = scale * (log.q_encoder - log.q_nominal)[log.ok, j]
            rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        q = log.q_nominal[:, j]
        joints.append(JointRange(name, unit, float(q.min()), float(q.max()), shown, rms, largest))
    return RecordingFacts(
        name=log.name,
        rows=len(log),
        measured_rows=int(log.ok.sum()),
        robot=log.robot,
        simulated=log.simulated,
        sha256=log.sha256,
        duration_s=duration,
        median_step_s=median,
        gaps=gaps,
        longest_gap_s=longest if gaps else None,
        joints=tuple(joints),
    )


def _check_identification(path: Path) -> FileReport:
    result, card = load_identification(path)
    recordings = [_torque_errors(result, one, "training") for one in result.training]
    recordings += [_torque_errors(result, one, "test") for one in result.tests]
    facts = DynamicsFacts(
        robot=result.model.name,
        terms=result.options.terms,
        base_parameters=result.base.count,
        condition=float(result.condition),
        physically_consistent=result.phi is not None,
        recordings=tuple(recordings),
        version=card["version"],
    )
    faults = [f"fails on {one.log}" for one in result.tests if one.verdict == "fails"]
    return FileReport("identified dynamics", facts, [*_copy_faults(path, card), *faults], list(card["notes"]))


def _copy_faults(path: Path, card: Card) -> list[str]:
    """Return whether the readable copy of a card, which may be missing, is another one."""
    copy = card_path(path)
    if not copy.is_file() or copy.read_bytes() == card_text(card).encode():
        return []
    return [f"{copy}: is not the card in {path.name}, which counts: it is another one's, or was edited; delete it"]


def _torque_errors(result: Identification, on: LogResidual, part: Part) -> TorqueErrors:
    relative = dict(zip(result.model.joint_names, map(float, on.relative_rms), strict=True))
    return TorqueErrors(on.log, part, on.verdict, relative)


def _check_model(path: Path) -> FileReport:
    model, card = load_model(path)
    unseen = {
        one["joint"]: UnseenErrors(one["rmse_mean"], one["rmse_sd"], one["offset_rmse_mean"])
        for one in (card["errors"]["cross_validation"] or {"joints": []})["joints"]
    }
    held_out = {one["name"]: HeldOutErrors(one["rmse"], one["offset_rmse"]) for one in card["errors"]["held_out"] or []}
    facts = ModelFacts(
        model=model.kind,
        preset=model.preset,
        robot=card["robot"],
        simulated=card["simulated"],
        joints=tuple(
            ModelJoint(name, unit, DISPLAY[unit][0], unseen.get(name), held_out.get(name))
            for name, unit in zip(model.joint_names, model.joint_units, strict=True)
        ),
        inputs=tuple(model.features.names),
        target=model.target,
        fitted_to=tuple(FittedTo(one["name"], one["sha256"]) for one in card["data"]),
        rows=card["rows"],
        seed=card["run"]["seed"],
        version=card["version"],
    )
    faults = [
        f"{name}: worse than the fixed offset on unseen blocks of time"
        for name, errors in unseen.items()
        if errors.is_worse_than_offset
    ]
    return FileReport("calibration model", facts, [*_copy_faults(path, card), *faults], list(card["notes"]))
