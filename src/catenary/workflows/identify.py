"""Identify a robot's dynamics from files and test the result; estimate payloads, external torques and wrist tools.

A wrist tool and its force/torque sensor's biases are identified from a table of poses at rest. Some joints of an arm
may be identified alone; the others are locked at the positions in the recordings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.external_torque import IN_95_PERCENT, ExternalTorque, external_wrench
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.file_formats import format_of
from catenary.files import write_atomically
from catenary.gravity.mass_plausibility import mass_doubts
from catenary.identification.drive_gains import DriveGains
from catenary.identification.explanations.findings import (
    GAINS,
    arm_as_found,
    day_findings,
    explained_torques,
    findings_against,
)
from catenary.identification.identification import CarriedBody, Identification, gains_of, identify_logs, prepared
from catenary.identification.identification_file import Card, identification_card, load_identification
from catenary.identification.identify_options import IdentifyOptions, filter_of
from catenary.identification.payload import PayloadEstimate, estimate_payload, payload_candidates
from catenary.identification.residuals import rms
from catenary.identification.samples import HELD_OUT, Samples, check_positions, prepare
from catenary.plant import JOINT_ARRAYS, Joints, MotionLog, joint_indices, joints_text
from catenary.recording.import_formats.table_files import read_rows
from catenary.recording.logs import Reading, read_torque_log
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.robots.submodels import lock_joints
from catenary.sensing.wrist_tool import WristTool, weigh_tool
from catenary.units import TORQUE_UNIT
from catenary.verdict.check import repeated_findings
from catenary.verdict.corrections import mends_of
from catenary.verdict.finding import judge, require_names
from catenary.verdict.timestamps import stamp_findings
from catenary.workflows.import_recording import import_recording

STILL = {"rad": 0.02, "m": 0.005}  # [rad], [m] largest motion of a held joint


def part_of_arm(
    model: RobotModel, joints: Sequence[str], logs: Sequence[MotionLog]
) -> tuple[RobotModel, dict[str, float]]:
    """Return a robot with only some of its joints, and the positions at which the others are held.

    Recordings with the other joints must hold them at one position; without any, they are at zero, clipped to limits.
    """
    joint_indices(Joints(tuple(joints)), model, whose=f'robot "{model.name}"', of="--joints are")
    held: dict[str, float] = {}
    for i, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True)):
        if name in joints:
            continue
        shown = [log.q_nominal[:, log.joint_names.index(name)] for log in logs if name in log.joint_names]
        where = np.concatenate(shown) if shown else np.clip(np.zeros(1), model.lower[i], model.upper[i])
        if np.ptp(where) > STILL[unit]:
            raise InputError(
                f"joint {name} is not among --joints, and moves from {where.min():.4g} to {where.max():.4g} {unit} "
                f"in the recordings: name it too, or take recordings that hold it (within {STILL[unit]:g} {unit})"
            )
        held[name] = float(np.clip(np.mean(where), model.lower[i], model.upper[i]))
    return (lock_joints(model, held) if held else model), held


def require_held(logs: Sequence[MotionLog], held: Mapping[str, float]) -> None:
    """Refuse recordings in which joints that were held in the identification move or are at other positions."""
    for log in logs:
        for name, unit, q in zip(log.joint_names, log.joint_units, log.q_nominal.T, strict=True):
            if name in held and np.abs(q - held[name]).max() > STILL[unit]:
                raise InputError(
                    f'recording "{log.name}": joint {name} goes from {q.min():.4g} to {q.max():.4g} {unit}, and was '
                    f"held at {held[name]:.4g} when others were identified: expected it there, within {STILL[unit]:g}"
                )


def of_joints(log: MotionLog, model: RobotModel) -> MotionLog:
    """Return a recording with only a robot's joints."""
    if len(log.joint_names) == model.n:
        return log.in_order_of(model, of="--joints are")
    chosen = joint_indices(model, log, whose=f'recording "{log.name}"', of="--joints are")
    arrays = {key: values[:, chosen] for key in JOINT_ARRAYS if (values := getattr(log, key)) is not None}
    omitted = [name for name in log.joint_names if name not in model.joint_names]
    notes = (*log.notes, f"joints left out: {joints_text(Joints(tuple(omitted)))}")
    return replace(log, joint_names=model.joint_names, joint_units=model.joint_units, notes=notes, **arrays)


STEADY_SHARE = 0.7  # share of the RMS and of the interval above which a mean counts as a steady torque
WRENCH = (*(f"force:{axis} [N]" for axis in "xyz"), *(f"moment:{axis} [Nm]" for axis in "xyz"))


@dataclass(frozen=True)
class ExternalTorques:
    """External torques of one recording, and the equivalent wrench on the tip, in base axes."""

    log: str
    model: RobotModel
    time: Floats  # (N,) [s]
    torque: Floats  # (N, n) [Nm or N] by inverse dynamics
    half_width: Floats  # (n,) [Nm or N] of the 95 % interval without contact
    wrench: Floats  # (N, 6) force [N], moment [Nm]; NaN for components that the joints do not feel
    wrench_half_width: Floats  # (N, 6)
    notes: tuple[str, ...]

    @property
    def joints(self) -> list[dict[str, Any]]:
        """Largest external torque of each joint [Nm or N], its time, and the share of rows beyond the interval."""
        size, units = np.abs(self.torque), [TORQUE_UNIT[unit] for unit in self.model.joint_units]
        rows, beyond = size.argmax(axis=0), np.mean(size > self.half_width, axis=0)
        largest = np.take_along_axis(self.torque, rows[None], axis=0)[0]
        numbers = (column.tolist() for column in (largest, self.time[rows], self.half_width, beyond))
        keys = ("joint", "unit", "largest", "time", "half_width", "beyond")
        columns = zip(self.model.joint_names, units, *numbers, strict=True)
        return [dict(zip(keys, row, strict=True)) for row in columns]

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "log": self.log,
            "rows": len(self.time),
            "joints": self.joints,
            "frame": self.model.tip,
            "largest_wrench": self.strongest(),
            "notes": list(self.notes),
        }

    def strongest(self) -> dict[str, Any] | None:
        """Return the wrench of the largest force and its time; None if the joints do not determine it."""
        force = np.linalg.norm(self.wrench[:, :3], axis=1)
        if not np.isfinite(force).any():
            return None
        row = int(np.nanargmax(force))
        return {
            "time": float(self.time[row]),
            "wrench": self.wrench[row].tolist(),
            "half_width": self.wrench_half_width[row].tolist(),
        }

    def write(self, path: Path) -> None:
        """Write all rows as CSV."""
        joints = zip(self.model.joint_names, self.model.joint_units, strict=True)
        named = [f"{name} [{TORQUE_UNIT[unit]}]" for name, unit in joints]
        within = np.tile(self.half_width, (len(self.time), 1))
        parts: list[tuple[str, Sequence[str], Floats]] = [("external", named, self.torque), ("within", named, within)]
        parts += [("tip", WRENCH, self.wrench), ("within:tip", WRENCH, self.wrench_half_width)]
        header = ["t [s]", *(f"{kind}:{name}" for kind, names, _ in parts for name in names)]
        rows = np.column_stack([self.time, *(values for _, _, values in parts)])
        lines = [",".join(header), *(",".join(f"{v:.9g}" for v in row) for row in rows)]
        write_atomically(path, ("\n".join(lines) + "\n").encode())


_POOR_RESIDUAL = 0.6  # relative residual above which a note is given


@dataclass(frozen=True)
class IdentifyResult:
    """An identification with its card, notes and samples."""

    identification: Identification
    card: Card
    notes: tuple[str, ...]
    training: tuple[Samples, ...]
    tests: tuple[Samples, ...]
    gains: DriveGains | None = None  # if currents were recorded

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        result = self.identification
        keys = "n_base condition rank robot physically_consistent prior friction bodies training tests notes"
        return {key: self.card[key] for key in keys.split()} | {
            "joints": list(result.model.joint_names),
            "terms": result.options.terms,
            "rotors": [rotor._asdict() for rotor in result.rotors],
            "drive_gains": None if self.gains is None else asdict(self.gains),
        }


def identify_files(
    logs: Sequence[Path],
    robot: str,
    options: IdentifyOptions,
    *,
    tests: Sequence[Path] = (),
    reading: Reading | None = None,
    load: tuple[float, Path] | None = None,
    payload: CarriedBody | None = None,
    joints: Sequence[str] = (),
    accept: Sequence[str] = (),
) -> IdentifyResult:
    """Identify a robot from recordings, and test it on others.

    Args:
        joints: Joints to identify, if the others are held; all if empty.
        load: For currents: mass [kg] on the robot's tip, and the recording with it, to identify drive gains.
        payload: Body that the robot carries in all recordings; a further one is identified with the arm.
        accept: Names of findings to continue despite.

    Raises:
        DataError: A finding, such as torques of the wrong sign or of swapped axes, is not accepted.
        ExcitationError: The recordings do not show all base parameters.
    """
    model, held = load_robot(robot), dict[str, float]()
    read, read_tests, with_loads = (
        [_recording(path, model, robot, joints, reading) for path in paths]
        for paths in (logs, tests, [] if load is None else [load[1]])
    )
    if joints:
        model, held = part_of_arm(model, joints, [*read, *read_tests, *with_loads])
        read, read_tests, with_loads = (
            [of_joints(log, model) for log in part] for part in (read, read_tests, with_loads)
        )
    if payload is not None:
        model = payload.on(model)
    require_names(accept)
    stamps = [(log.name, finding) for log in (*read, *read_tests) for finding in stamp_findings(log)]
    stamps += repeated_findings((*read, *read_tests))
    gains, weighed = None, list[Samples]()
    if reading is not None and reading.currents and (model.actuation is None or model.actuation.effort_scale is None):
        if load is None:
            raise InputError(
                f'currents of robot "{model.name}", whose drive gains are not known, tell masses up to a factor of '
                "each axis: give a recording with a known load (--load KG LOG), or the gains (--scale tau:JOINT=GAIN)"
            )
        alone, loaded = ([prepare(log, model, options) for log in part] for part in (read, with_loads))
        gains = gains_of(alone, loaded, model, options, load[0])
        read, read_tests = ([_times(log, gains.gains) for log in part] for part in (read, read_tests))
        weighed = [prepare(_times(log, gains.gains), model, options) for log in with_loads]
    training, held_out = prepared(read, read_tests, model, options, within_limits=False)
    whole = [part for part in (*training, *held_out) if not part.name.endswith(HELD_OUT)]
    gaps = [f"{part.name}: {note}" for part in whole for note in part.notes]
    settled = () if gains is None else GAINS
    explained = [explained_torques(model, part, settled) for part in training]
    causes = [(part.name, one) for part, (ones, _) in zip(training, explained, strict=True) for one in ones]
    doubts = judge(causes, accept)
    model, loads = arm_as_found(model, [explanation for _, explanation in explained])
    for log in (*read, *read_tests):  # after findings that may explain the positions
        check_positions(log, model)
    bodies = (*((payload,) if payload is not None else ()), *loads)
    result = replace(identify_logs(read, training, model, options), bodies=bodies).test(held_out)
    tested = [part for part in held_out if not part.name.endswith(HELD_OUT)]
    doubts += judge([(part.name, finding) for part in tested for finding in findings_against(result, part)], accept)
    if gains is not None:
        result = result.with_gains(gains.gains)
    notes = [*(note for log in (*read, *read_tests) for note in log.named_notes), *gaps]
    if held:
        values = ", ".join(f"{name} {value:.4g}" for name, value in held.items())
        notes.append(f"{', '.join(joints)} are identified; held: {values}")
    known = [log.identity for log in read]
    again = [log.name for log in read_tests if log.is_among(known)]
    notes += [f"{name}: is one of the recordings that were fitted: no test" for name in again]
    notes += [*_notes(model, result), *result.base_notes([*training, *held_out])]
    if gains is not None:
        shown = estimate_payload(result, weighed, at=(model.tip, gains.centre))
        notes += [
            *gains.notes(model),
            f"{weighed[0].name}: according to the identification, the load weighs {shown.mass or 0.0:.3f} kg, "
            f"stated {gains.load:g}",
        ]
    notes += judge([*stamps, *day_findings(model, training)], accept)
    notes += doubts
    uses = [*((log, "fitted") for log in read), *((log, "tested") for log in read_tests)]
    data = [{"log": log.name, "sha256": log.sha256, "rows": len(log), "use": use} for log, use in uses]
    card = identification_card(result, data, tuple(notes), mends_of(read)) | {"held": held}
    return IdentifyResult(result, card, tuple(notes), tuple(training), tuple(held_out), gains)


def _recording(path: Path, model: RobotModel, robot: str, joints: Sequence[str], reading: Reading | None) -> MotionLog:
    """Read a recording of a robot, also a third-party one; with only some `joints`, by name or in their order."""
    if (reading is None or reading.mapping is None) and format_of(path).ending not in (".npz", ".parquet"):
        # a known layout, or the proposal of a mapping in the refusal
        return (reading or Reading()).mend(import_recording(path, robot=robot))
    return read_torque_log(path, model, reading, joints=joints)


def _times(log: MotionLog, gains: Floats) -> MotionLog:
    return log if log.tau is None else replace(log, tau=log.tau * gains)


def _notes(model: RobotModel, result: Identification) -> Iterator[str]:
    options = result.options
    static = options.terms == "static"
    if not static and model.assumed_actuation.find_rotors:  # no table
        used = filter_of(model, options)
        yield (
            f"{model.name}: its file states no filter: assumed friction on every joint, a filter of order {used.order} "
            f"at {used.cutoff_hz:g} Hz, {used.cut_s:.2g} s cut at each end"
        )
    yield from (f"{test.log}: {test.verdict}: {why}" for test in result.tests for why in test.reasons)
    for residual in (*result.training, *result.tests):
        shares = zip(result.model.joint_names, residual.relative_rms, strict=True)
        if poor := [f"{name} ({share:.2f} of it is left)" for name, share in shares if share > _POOR_RESIDUAL]:
            yield f"{residual.log}: little of the torque is explained of {', '.join(poor)}"
    yield from mass_doubts(result.robot(), described=model) if result.phi is not None else ()
    by_kind: dict[str, list[str]] = {}
    for part in result.friction:
        scale = "" if part.scale is None else f" ({part.scale:.2g})"
        by_kind.setdefault(part.kind, []).append(f"{part.friction}{scale}")
    for kind, names in by_kind.items():
        yield f"friction: {kind} part added to {', '.join(names)}: held-out blocks are predicted better"
    actuation, last = result.model.actuation, result.training[-1].log
    if actuation is not None and any(friction.recording for friction in actuation.friction):
        yield (
            "friction: separate for each recording, with common masses: held-out blocks are predicted better; the "
            f"robot and the tests have that of {last}"
        )
    if result.unshown:
        hidden = ", ".join(result.unshown)
        yield f"rotors that the motion does not determine: {hidden}; move each joint alone and faster"


def payload_of_files(
    logs: Sequence[Path],
    model: Path,
    *,
    at: tuple[str, Sequence[float]] | None = None,
    unloaded: Sequence[Path] = (),
    **how: Any,
) -> tuple[tuple[PayloadEstimate, ...], list[str]]:
    """Estimate the payload of an identified arm from recordings, whose torques are checked for sign and unit first.

    Args:
        model: Identification of the arm without it.
        at: Frame, and the payload's position in it (3,) [m], if known.
        unloaded: Recordings without the payload, of the same day.
        **how: Mapping, corrections and accepted findings.

    Returns:
        The payload on the likeliest link, then on others if its location was not given; and notes.
    """
    result, samples, notes = _read_for(model, (*logs, *unloaded), of_arm=False, **how)  # of a load the estimate tells
    loaded, empty = samples[: len(logs)], samples[len(logs) :]
    estimates = payload_candidates(result, loaded, at=at, unloaded=empty)
    best = estimates[0]
    if best.rival:
        notes.append(f"a load on {best.link} cannot be distinguished from {best.rival}")
    if best.mass is None:
        notes.append("the motion determines mass times position, not the mass alone; give the position with --at")
    return estimates, notes


def external_torques_of_file(log: Path, model: Path, *, unloaded: Sequence[Path] = (), **how: Any) -> ExternalTorques:
    """Estimate the external torques on an arm's joints in a recording: M qdd + C qd + g + friction - tau.

    The interval is 1.96 times the RMS residual on `unloaded` recordings, else on the tests of the identification.

    Args:
        unloaded: Recordings without external torques, of the same day.
        **how: Mapping, corrections and accepted findings.
    """
    result, (pushed, *untouched), notes = _read_for(model, (log, *unloaded), **how)
    arm, torque = result.model, result.predict_samples(pushed) - pushed.tau
    if untouched:
        deviation = rms(np.concatenate([result.predict_samples(part) - part.tau for part in untouched]))
    else:
        deviation = np.max([residual.rms for residual in result.tests or result.training], axis=0)
        if not result.tests:
            notes.append("intervals are by the residual of the recordings that were fitted: give one with --unloaded")
    half_width = IN_95_PERCENT * deviation
    widths = np.maximum(half_width, 1e-9 * max(1.0, float(half_width.max())))
    wrenches = [external_wrench(arm, q, ExternalTorque(row, widths)) for q, row in zip(pushed.q, torque, strict=True)]
    wrench, width = (np.array(values) for values in zip(*wrenches, strict=True))
    if not np.isfinite(wrench).any():
        notes.append(f"{arm.n} joints cannot separate the components of a force on {arm.tip}")
    steady, size = torque.mean(axis=0), STEADY_SHARE * np.maximum(half_width, rms(torque))
    for k in np.flatnonzero(np.abs(steady) > size):
        notes.append(
            f"{arm.joint_names[k]}: {steady[k]:+.3g} {TORQUE_UNIT[arm.joint_units[k]]} throughout: a shifted zero of "
            "its torque looks like a steady push; begin the recording untouched"
        )
    return ExternalTorques(pushed.name, arm, pushed.time, torque, half_width, wrench, width, tuple(notes))


def changes_of_files(model: Path, logs: Sequence[Path], **how: Any) -> tuple[list[dict[str, Any]], list[str]]:
    """Estimate the changes of an identified arm from later recordings: zeros, gains, loads and friction.

    Args:
        model, logs: Identification of the arm, and later recordings.
        **how: Mapping, corrections and accepted findings.

    Returns:
        The changes, which are not refused: recording, finding (name in FINDINGS), joints and what it says; and notes.
    """
    result, samples, notes, read = _read(model, logs, **how)
    findings = [(part.name, finding) for part in samples for finding in findings_against(result, part)]
    for log in () if findings else read:
        check_positions(log, result.model)
    keys = ("recording", "finding", "joints", "says")
    rows = ((name, finding.name, finding.joints, finding.says) for name, finding in findings)
    return [dict(zip(keys, row, strict=True)) for row in rows], notes


def _read_for(
    model: Path, paths: Sequence[Path], *, accept: Sequence[str] = (), of_arm: bool = True, **how: Any
) -> tuple[Identification, list[Samples], list[str]]:
    """Return an identification, recordings filtered as in it, and notes, after refusing findings not accepted.

    Findings about the arm itself, such as a load, are included if `of_arm`.
    """
    result, samples, notes, read = _read(model, paths, accept=accept, **how)
    findings = [(s.name, finding) for s in samples for finding in findings_against(result, s)]
    notes += judge([named for named in findings if of_arm or named[1].name != "arm"], accept, done="weighed")
    for log in read:  # after findings that may explain the positions
        check_positions(log, result.model)
    return result, samples, notes


def _read(
    model: Path,
    paths: Sequence[Path],
    *,
    cutoff_hz: float | None = None,
    reading: Reading | None = None,
    accept: Sequence[str] = (),
) -> tuple[Identification, list[Samples], list[str], list[MotionLog]]:
    """Return an identification, recordings filtered as in it, notes, and the recordings as read."""
    result, card = load_identification(model)
    # without corrections of units: degrees exceed the robot's limits, but rad converted once more would pass
    mends = {key: texts for key, texts in card.get("mends", {}).items() if key != "units"}
    options = result.options if cutoff_hz is None else replace(result.options, cutoff_hz=cutoff_hz)
    require_names(accept)
    held: dict[str, float] = card.get("held", {})
    few = result.model.joint_names if held else ()
    read = [read_torque_log(path, result.model, reading, mends, joints=few) for path in paths]
    if held:
        require_held(read, held)
        read = [of_joints(log, result.model) for log in read]
    notes = judge([(log.name, finding) for log in read for finding in stamp_findings(log)], accept, done="weighed")
    notes += [note for log in read for note in log.named_notes]
    samples = [prepare(log, result.model, options, within_limits=False) for log in read]
    notes += [f"{part.name}: {note}" for part in samples for note in part.notes]
    return result, samples, notes, read


WRENCH_AXES = ("fx", "fy", "fz", "tx", "ty", "tz")  # [N], [Nm] in the sensor's axes


def wrist_tool_of_file(
    path: Path, model: RobotModel, frame: str | None, gravity: ArrayLike, accept: Sequence[str] = ()
) -> tuple[WristTool, list[str]]:
    """Identify a tool at a force/torque sensor from a table with a row for each pose at rest; with notes on findings.

    Args:
        path: Table with columns of the joints by name [rad|m], and `WRENCH_AXES` [N, Nm].
        frame: Frame that carries the sensor; the tip when None.
        gravity: Free-fall acceleration in base axes (3,) [m/s2].
        accept: Names of findings to continue despite.
    """
    rows = read_rows(path, (*model.joint_names, *WRENCH_AXES))
    q, force, torque = np.split(rows, [model.n, model.n + 3], axis=1)
    tool, doubts = weigh_tool(force, torque, forward_kinematics(model, q, frame), gravity)
    return tool, judge([(path.name, finding) for finding in doubts], accept, done="weighed")
