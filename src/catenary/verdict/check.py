"""Checks of recordings before calibration: all findings, most severe first, and whether they may be fitted."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.errors import InputError
from catenary.parallel import of_each
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.units import DISPLAY
from catenary.verdict.command_response import MOVED_BY_OTHERS_DEG_MM, MOVED_DEG_MM, Pairs, pairs_of, scales
from catenary.verdict.corrections import NO_MEND, Mend
from catenary.verdict.correspondence import correspondence_findings, joints_in_place, proportional_findings
from catenary.verdict.delay import Delay
from catenary.verdict.finding import FINDINGS, Finding, judge, require_names
from catenary.verdict.sensor_faults import (
    coarse_findings,
    filled_findings,
    missing_findings,
    outlier_findings,
    sensor_findings,
    zero_findings,
)
from catenary.verdict.time_shifts import delay_findings
from catenary.verdict.timestamps import arrival_findings, count_poses, stamp_findings
from catenary.verdict.units_and_scale import (
    range_findings,
    slope_findings,
    tiny_findings,
    trained_findings,
    within_reason,
)
from catenary.verdict.zero_shifts import leap_findings, turn_findings

_MAX_SHARED_SHARE = 0.01  # share of test rows that may be in the training data, as resting poses repeat
_MAX_HASHES = 1_000_000  # number of hashes compared
MAX_ERROR_OPTION = "--max-error"
_MEND_ROUNDS = 4  # rounds of corrections, as one fault may hide another
# steps that change the estimated delay (a sign because friction always opposes motion)
_TIMING_STEPS = "time_unit", "sign", "clock", "delay", "shift"
_REPEATED_ROWS = 20  # rows of motion that only a copy repeats digit by digit


KnownDelays = dict[Mend, list[Finding]]  # findings about a recording's delay, by correction


class Judged(NamedTuple):
    """Findings about a recording, and the recording corrected by options."""

    findings: tuple[Finding, ...]  # most severe first
    mend: Mend
    log: MotionLog
    left: list[str]  # names of refusing findings that remain after correction


def findings_of(
    log: MotionLog, *, robot: RobotModel | None = None, max_error: Floats | None = None
) -> tuple[Finding, ...]:
    """Return findings about a recording, most severe first.

    Args:
        log, robot, max_error: See `judged`.
    """
    return judged(log, robot=robot, max_error=max_error).findings


def judged(
    log: MotionLog,
    mend: Mend = NO_MEND,
    *,
    robot: RobotModel | None = None,
    max_error: Floats | None = None,
    trained: tuple[Floats, Floats] | None = None,
    alone: bool = True,
    delays: KnownDelays | None = None,
) -> Judged:
    """Find faults of a recording; each fault is corrected to find others that it hides, which then say so.

    Args:
        log, mend: Recording, and the correction to apply first.
        robot: Robot whose limits positions are compared with, by the names of joints.
        max_error: Leave out rows with larger errors, as a fit does, (n,) [rad|m].
        trained: Lowest and highest positions in training (n,) each.
        alone: Also search for duplicated segments.
        delays: Known delays of this recording, robot and limits; new ones are added.
    """
    findings, seen, begun = list[Finding](), list[Finding](), mend
    delays = {} if delays is None else delays
    for _ in range(_MEND_ROUNDS):
        mended = mend(log)
        if max_error is not None and mended.q_encoder is not None:
            with np.errstate(invalid="ignore"):
                within = (np.abs(mended.q_encoder - mended.q_nominal) <= max_error).all(axis=1)
            mended = replace(mended, ok=mended.ok & within)
        changed = (
            {step for step in _TIMING_STEPS if getattr(mend, step) != getattr(begun, step)} if mend != begun else None
        )
        late = (
            []
            if changed is None or changed
            else [finding for finding in seen if finding.name in ("clock", "delay", "lag")]
        )
        late_of = partial(_late, delays, mend) if changed is None or changed else None
        seen = [*_together(mended, robot, trained, late_of, changed), *late]
        findings += _as_if(mend, begun, seen, findings)
        more = mend
        for finding in seen:
            more = (more.and_then(finding.remedy) if finding.refuses else None) or more
        try:
            if more == mend or not more(log).ok.any():
                break
        except InputError:  # such as a shift that leaves no row
            break
        mend = more
    if (pairs := pairs_of(mended)) is not None:  # single rows, after faults of all rows, which look like outliers
        single = [
            *outlier_findings(mended), *coarse_findings(pairs), *filled_findings(mended), *missing_findings(mended),
            *proportional_findings(pairs),
        ]  # fmt: skip
        wrong = {joint for finding in seen if finding.refuses for joint in finding.joints}
        findings += _as_if(mend, begun, (finding for finding in single if wrong.isdisjoint(finding.joints)), findings)
    findings += [each for _, each in repeated_findings([mended])] * alone
    left = [finding.name for finding in seen if finding.refuses and not finding.remedy.startswith(MAX_ERROR_OPTION)]
    findings.sort(key=lambda each: each.severity)
    return Judged(tuple(findings), mend, mended, list(dict.fromkeys(left)))


def _as_if(mend: Mend, begun: Mend, seen: Iterable[Finding], known: Sequence[Finding]) -> list[Finding]:
    """Return new findings, each stating the correction under which it appeared; not those the correction causes."""
    known_names = {(finding.name, joint) for finding in known for joint in finding.joints or ("",)}
    new = [
        finding
        for finding in seen
        if known_names.isdisjoint((finding.name, joint) for joint in finding.joints or ("",))
    ]
    if mend == begun:
        return new
    made = {*(name for name, kind in FINDINGS.items() if kind.learning), *(("missing",) if mend.leave_out else ())}
    shown = f" (seen as if mended by {' '.join(mend.options)})"
    new = [finding for finding in new if finding.name not in made and (finding.refuses or finding.name != "delay")]
    return [replace(finding, says=finding.says + shown) for finding in new]


def _late(delays: KnownDelays, mend: Mend, pairs: Pairs, place: Integers) -> list[Finding]:
    """Return findings about delays under a correction, cached for commands with several models."""
    if mend not in delays:
        delays[mend] = delay_findings(pairs, place)
    return delays[mend]


def _together(
    log: MotionLog,
    robot: RobotModel | None,
    trained: tuple[Floats, Floats] | None,
    late_of: Callable[[Pairs, Integers], list[Finding]] | None,
    changed: Collection[str] | None,
) -> list[Finding]:
    """Return findings about all rows, and about the relation of measurements to commands.

    `changed` are steps of a correction that affect delays (None without correction); `late_of` finds delays (None if
    they are known).
    """
    log, far = within_reason(log, robot)
    ranges = ([] if trained is None else trained_findings(log, trained)) or range_findings(log, robot)
    findings = [*extent_findings(log), *stamp_findings(log, in_si=not ranges), *far, *ranges, *tiny_findings(log)]
    pairs = pairs_of(log)
    if pairs is not None:
        wrong = {joint for finding in findings if finding.refuses for joint in finding.joints}
        findings += _relation(pairs, wrong, late_of, changed)
        delay = next((finding.delay for finding in findings if finding.delay is not None), None)
        findings += [*arrival_findings(log, delay), *zero_findings(log)]
    return findings


def _relation(
    pairs: Pairs,
    wrong: Collection[str],
    late_of: Callable[[Pairs, Integers], list[Finding]] | None,
    changed: Collection[str] | None,
) -> list[Finding]:
    """Return findings about measurements against commands, each with its first cause, except of joints in `wrong`."""
    turns, pairs = turn_findings(pairs)
    place = joints_in_place(pairs)
    still, stuck = sensor_findings(pairs, place)
    # rows where a sensor stands still would look like a growing delay
    moving = replace(pairs, log=replace(pairs.log, ok=pairs.log.ok & ~stuck)) if stuck.any() else pairs
    late = [] if late_of is None else late_of(moving, place)
    swapped, single = correspondence_findings(pairs, place)
    if swapped or single:  # swapped or mixed columns seem to have different delays
        late = [finding for finding in late if not finding.joints]
    in_step = changed is not None and not {"clock", "delay", "shift"}.isdisjoint(changed)
    if not in_step and any(finding.refuses and finding.name == "delay" for finding in late):
        return [*swapped, *turns, *late]  # slopes of delayed rows mean nothing
    # nor do slopes and leaps of columns of another scale or joint
    parted = {joint for finding in single if finding.refuses and finding.name == "mixed" for joint in finding.joints}
    first = [*single, *(finding for finding in slope_findings(pairs, place) if parted.isdisjoint(finding.joints))]
    wrong = {*wrong, *(joint for finding in first for joint in finding.joints)}
    others = [finding for finding in (*still, *leap_findings(pairs, place)) if not set(wrong) & set(finding.joints)]
    turned, shown = {joint for finding in turns for joint in finding.joints}, " (seen as if brought into one turn)"
    others = [
        replace(finding, says=finding.says + shown * bool(turned & set(finding.joints)))
        for finding in (*first, *others)
    ]
    return [*swapped, *turns, *late, *others]


def robot_of(logs: Sequence[MotionLog], robot: str | None = None) -> RobotModel | None:
    """Return the robot model of recordings, None if unknown.

    Args:
        logs, robot: Recordings, and catalogue name or file of their robot, by default the name in the recordings.
    """
    if robot is not None and (robot in robot_names() or Path(robot).is_file()):
        return load_robot(robot)
    named = {log.robot for log in logs}
    name = named.pop() if len(named) == 1 else None
    return load_robot(name) if name in robot_names() and name is not None else None


class Passed(NamedTuple):
    """Notes on accepted recordings, and the delay of each one's measurements (None if unknown)."""

    notes: list[str]
    delays: list[Delay | None]


def verdict(
    logs: Sequence[MotionLog],
    *,
    accept: Collection[str] = (),
    robot: RobotModel | None = None,
    max_error: Floats | None = None,
    testing: bool = False,
    trained: tuple[Floats, Floats] | None = None,
    done: str = "fitted",
    delays: Sequence[KnownDelays] | None = None,  # of each; see `judged`
) -> Passed:
    """Refuse recordings whose findings forbid a fit or a test; return notes and delays.

    Args:
        logs, robot, max_error, trained, delays: See `judged`; `delays` of each recording.
        accept: Names of findings to ignore.
        testing: The recordings are tests, which may be short.
        done: Participle for the message "nothing was ...".
    """
    require_names(accept)
    how: dict[str, Any] = {"robot": robot, "max_error": max_error, "trained": trained, "alone": False}
    known = [KnownDelays() for _ in logs] if delays is None else delays
    own = of_each(lambda each, _: judged(each[0], delays=each[1], **how).findings, [*zip(logs, known, strict=True)])
    findings_by_name = [(log.name, finding) for log, findings in zip(logs, own, strict=True) for finding in findings]
    if testing:
        findings_by_name = [(name, each) for name, each in findings_by_name if not FINDINGS[each.name].learning]
    else:
        findings_by_name += repeated_findings(logs)
    of_name = {name: each.delay for name, each in findings_by_name if each.delay is not None}
    return Passed(judge(findings_by_name, accept, done=done), [of_name.get(log.name) for log in logs])


def require_apart(train: Sequence[MotionLog], test: Sequence[MotionLog], accept: Collection[str] = ()) -> list[str]:
    """Refuse test recordings that share rows with the training, to seven digits; return notes on accepted findings.

    Args:
        train, test, accept: Recordings of each, and names of findings to ignore.
    """
    findings = []
    for log in test:
        own = np.unique(log.row_hashes[log.ok])
        for other in train:
            same = len(np.intersect1d(own, other.row_hashes[other.ok]))
            if same > _MAX_SHARED_SHARE * len(own):
                says = f'{same} of its {len(own)} measured rows are in "{other.name}", which is trained on'
                culprit = "one recording copied, cut or renamed"
                findings.append((log.name, Finding("tested", (), says, culprit)))
            elif log.was_there(other.poses):
                says = f'at its times the arm was where "{other.name}" has it, which is trained on'
                findings.append((log.name, Finding("tested", (), says, "one recording, read at another rate")))
    return judge(findings, accept)


def repeated_findings(logs: Sequence[MotionLog]) -> list[tuple[str, Finding]]:
    """Return notes on duplicated segments, to seven digits, which leak held-out blocks into a fit."""
    hashes, where = [], []
    sample = np.uint64(1 + sum(map(len, logs)) // _MAX_HASHES)  # sampled by value, so that copies are sampled alike
    for number, log in enumerate(logs):
        if log.q_encoder is not None or log.tau is not None:
            of_row = log.row_hashes[log.ok]
            of_row = of_row[np.diff(of_row, prepend=np.uint64(0)) != 0]
            factors = np.random.default_rng(0).integers(1, 2**63, _REPEATED_ROWS, dtype=np.uint64)
            count = max(0, len(of_row) - _REPEATED_ROWS + 1)
            stretches = sum(
                (of_row[k : k + count] * factors[k] for k in range(_REPEATED_ROWS)), np.zeros(count, np.uint64)
            )
            stretches = stretches[stretches % sample == 0]
            hashes.append(stretches)
            where.append(np.full(len(stretches), number, dtype=np.int32))
    if not hashes:
        return []
    _, first = np.unique(np.concatenate(hashes), return_index=True)
    numbers = np.concatenate(where)
    again = np.ones(len(numbers), dtype=bool)
    again[first] = False
    findings, known = [], [(log.name, log.poses) for log in logs]
    for number, log in enumerate(logs):
        says = [f'its minutes are those of "{other}"' for other, poses in known[:number] if log.was_there(poses)]
        share = float(again[numbers == number].mean()) if (numbers == number).any() else 0.0
        if share > _MAX_SHARED_SHARE:
            says = [f"{share:.0%} of its motion is in the data twice, digit by digit"]
        if says:
            culprit = "one recording copied, joined to itself, or read at another rate"
            reason = f"{says[0]}: it is no independent test"
            findings.append((log.name, Finding("twice", (), reason, culprit, refuses=False)))
    return findings


_MIN_ROWS = 40  # smallest number of measured rows for cross-validation over blocks
_MIN_DURATION_S = 5.0  # [s] too short for an arm to visit its workspace


def extent_findings(log: MotionLog) -> Iterator[Finding]:
    """Find recordings that are too short, and columns that never change."""
    measured = int(log.ok.sum()) if log.q_encoder is not None else len(log)
    if log.q_encoder is not None and not measured:
        yield Finding("short", (), "ok is set on no row: nothing was measured")
        return
    if poses := count_poses(log):
        says = f"commands leap between {poses} poses and rest there: all rows of a pose hold the same information"
        yield Finding("short", (), says, "a staircase, which shows neither slack nor delays", refuses=False)
    if measured < _MIN_ROWS:
        says = f"{measured} measured rows, expected at least {_MIN_ROWS}"
        yield Finding("short", (), says, "a recording that was cut off")
    steps = np.diff([] if log.time is None else log.time)
    if 0.0 < (seconds := float(steps[steps > 0.0].sum())) < _MIN_DURATION_S:
        says = f"{seconds:.3g} s, expected at least {_MIN_DURATION_S:g}"
        yield Finding("short", (), says, "a recording that was cut off, or stamps in another unit")
    scale = scales(log)
    moved = np.ptp(scale * log.q_nominal, axis=0)
    still = [name for name, x in zip(log.joint_names, moved, strict=True) if x == 0.0]
    if (moved < MOVED_DEG_MM).all():
        says = f"no joint was moved by more than {moved.max():.3g} deg or mm; expected {MOVED_DEG_MM:g} or more"
        yield Finding("constant", (), says, "a recording of an arm at rest")
    elif still:
        yield Finding("constant", tuple(still), "never moved; a model is valid only at its position", refuses=False)
    if log.q_encoder is not None and log.ok.any():
        seen = scale * log.q_encoder[log.ok]
        spans = np.ptp(np.percentile(seen, [1.0, 99.0], axis=0), axis=0)
        joints = zip(log.joint_names, log.joint_units, moved, seen.T, spans, strict=True)
        for name, unit, command, column, span in joints:
            shown = DISPLAY[unit][0]
            if np.ptp(column) == 0.0 and command > MOVED_DEG_MM:
                says = f"every measurement is {column[0]:.4g} {shown}, while the command moves by {command:.3g}"
                yield Finding("constant", (name,), says, "a channel without a sensor")
            elif command == 0.0 and span > MOVED_BY_OTHERS_DEG_MM[unit]:
                says = f"every command is the same, while the measurement moves by {span:.3g} {shown}"
                yield Finding("constant", (name,), says, "a channel that was not recorded")
    for what, values in (("torque", log.tau), ("velocity", log.qd)):
        flat = (
            np.zeros(len(moved), bool) if values is None else (np.ptp(values, axis=0) == 0.0) & (moved > MOVED_DEG_MM)
        )
        if names := tuple(name for name, same in zip(log.joint_names, flat, strict=True) if same):
            says = f"the recorded {what} never changes, while the joint moves"
            yield Finding("constant", names, says, "a channel that was not recorded", refuses=False)
