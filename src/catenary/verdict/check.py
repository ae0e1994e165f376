"""The verdict on recordings of which a calibration model is to be made: every check, in order."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.side_by_side import of_each
from catenary.units import DISPLAY
from catenary.verdict.correspondence import correspondence_findings, joints_in_place
from catenary.verdict.delay import Delay
from catenary.verdict.finding import Finding, judge, require_names
from catenary.verdict.levels import leap_findings, turn_findings
from catenary.verdict.out_of_step import delay_findings
from catenary.verdict.pairs import MOVED, Pairs, pairs_of, scales
from catenary.verdict.sensors import (
    coarse_findings,
    filled_findings,
    missing_findings,
    outlier_findings,
    sensor_findings,
    zero_findings,
)
from catenary.verdict.stamps import arrival_findings, stamp_findings
from catenary.verdict.units_and_scale import range_findings, slope_findings, tiny_findings, trained_findings

NEEDED_TO_LEARN = ("short", "constant")  # what a test does well without
MOST_SHARED = 0.01  # share of a test's rows that may be in the training; poses that rest repeat themselves
MOST_HASHES = 1_000_000  # that are compared
REPEATED_ROWS = 20  # of motion, that no other minutes repeat digit by digit


def findings_of(
    log: MotionLog,
    *,
    robot: RobotModel | None = None,  # whose limits positions are held against, by the names of joints
    max_error: Floats | None = None,  # (n,) [rad|m]; rows with larger errors are left out, as a fit leaves them out
) -> tuple[Finding, ...]:
    """Return what is wrong with a recording, and what is worth knowing, the gravest first."""
    return (*_alone(log, robot, max_error, None), *(each for _, each in repeated_findings([log])))


def _alone(
    log: MotionLog, robot: RobotModel | None, max_error: Floats | None, trained: tuple[Floats, Floats] | None
) -> list[Finding]:
    """Find what is wrong with a recording, the gravest first, but for minutes that are there twice, or in others."""
    if max_error is not None and log.q_encoder is not None:
        with np.errstate(invalid="ignore"):
            within = (np.abs(log.q_encoder - log.q_nominal) <= max_error).all(axis=1)
        log = replace(log, ok=log.ok & within)
    ranges = ([] if trained is None else trained_findings(log, trained)) or range_findings(log, robot)
    findings = [*extent_findings(log), *stamp_findings(log, in_si=not ranges), *ranges, *tiny_findings(log)]
    pairs = pairs_of(log)
    if pairs is not None:
        findings += _relation(pairs, {joint for each in findings if each.refuses for joint in each.joints})
        delay = next((each.delay for each in findings if each.delay is not None), None)
        findings += [*arrival_findings(log, delay), *zero_findings(log)]
        if not any(each.refuses for each in findings):  # what is wrong everywhere is far from the rest somewhere
            findings += [*outlier_findings(log), *coarse_findings(pairs), *filled_findings(log), *missing_findings(log)]
    return sorted(findings, key=lambda each: not each.refuses)


def _relation(pairs: Pairs, wrong: Collection[str]) -> list[Finding]:
    """Find what is wrong between measurements and commands, each under its first cause, but of joints known `wrong`."""
    turns = [*turn_findings(pairs)]
    turned = {joint for each in turns for joint in each.joints}
    place = joints_in_place(pairs)
    still = sensor_findings(pairs, place)
    # a sensor that stands still lies behind more and more
    late = [] if any(each.refuses for each in still) else delay_findings(pairs, place)
    swapped, single = correspondence_findings(pairs, place)
    if swapped or single:  # sums of joints, and columns of others, lie unlike times behind
        late = [each for each in late if not each.joints]
    if any(each.refuses for each in late):  # rows out of step follow nothing, and their slopes mean nothing
        return [*swapped, *turns, *late]
    # correlations and slopes of measurements on two levels mean nothing either
    first = [each for each in (*single, *slope_findings(pairs, place)) if not turned & set(each.joints)]
    wrong = {*wrong, *turned, *(joint for each in first for joint in each.joints)}
    others = [*still, *leap_findings(pairs, place)]
    return [*swapped, *turns, *late, *first, *(each for each in others if not wrong & set(each.joints))]


def robot_of(logs: Sequence[MotionLog], robot: str | None = None) -> RobotModel | None:
    """Return the robot that recordings are of: the one of that name, or of theirs in the catalogue; None unknown."""
    if robot is not None and (robot in robot_names() or Path(robot).is_file()):
        return load_robot(robot)
    named = {log.robot for log in logs}
    name = named.pop() if len(named) == 1 else None
    return load_robot(name) if name in robot_names() and name is not None else None


class Passed(NamedTuple):
    """What there is to say of recordings that may be used, and by how much their measurements lie behind."""

    notes: list[str]
    delays: list[Delay | None]  # of each; None where it is not known


def verdict(
    logs: Sequence[MotionLog],
    *,
    accept: Collection[str] = (),
    robot: RobotModel | None = None,
    max_error: Floats | None = None,
    testing: bool = False,
    trained: tuple[Floats, Floats] | None = None,
    done: str = "fitted",
) -> Passed:
    """Refuse recordings that no model is to be made from, or tested on; return what is worth knowing of others."""
    require_names(accept)
    own = of_each(lambda log, _: _alone(log, robot, max_error, trained), logs)
    found = [(log.name, each) for log, findings in zip(logs, own, strict=True) for each in findings]
    if testing:
        found = [(name, each) for name, each in found if each.name not in NEEDED_TO_LEARN]
    else:
        found += repeated_findings(logs)
    of_name = {name: each.delay for name, each in found if each.delay is not None}
    return Passed(judge(found, accept, done=done), [of_name.get(log.name) for log in logs])


def require_apart(train: Sequence[MotionLog], test: Sequence[MotionLog], accept: Collection[str] = ()) -> list[str]:
    """Refuse tests of which rows were trained on, to seven digits, whatever their file is called; note the accepted."""
    found = []
    for log in test:
        own = np.unique(log.row_hashes[log.ok])
        for other in train:
            same = len(np.intersect1d(own, other.row_hashes[other.ok]))
            if same > MOST_SHARED * len(own):
                says = f'{same} of its {len(own)} measured rows are in "{other.name}", which is trained on'
                culprit = "one recording copied, cut or renamed"
                found.append((log.name, Finding("tested", (), says, culprit)))
            elif log.was_there(other.poses):
                says = f'at its times the arm was where "{other.name}" has it, which is trained on'
                found.append((log.name, Finding("tested", (), says, "one recording, read at another rate")))
    return judge(found, accept)


def repeated_findings(logs: Sequence[MotionLog]) -> list[tuple[str, Finding]]:
    """Note minutes that are in the data twice, to seven digits: a fit then sees blocks that are left out."""
    hashes, where = [], []
    sample = np.uint64(1 + sum(map(len, logs)) // MOST_HASHES)  # of what they are: copies are sampled alike
    for number, log in enumerate(logs):
        if log.q_encoder is not None or log.tau is not None:
            of_row = log.row_hashes[log.ok]
            of_row = of_row[np.diff(of_row, prepend=np.uint64(0)) != 0]
            factors = np.random.default_rng(0).integers(1, 2**63, REPEATED_ROWS, dtype=np.uint64)
            count = max(0, len(of_row) - REPEATED_ROWS + 1)
            stretches = sum(
                (of_row[k : k + count] * factors[k] for k in range(REPEATED_ROWS)), np.zeros(count, np.uint64)
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
    found, known = [], [(log.name, log.poses) for log in logs]
    for number, log in enumerate(logs):
        says = [f'its minutes are those of "{other}"' for other, poses in known[:number] if log.was_there(poses)]
        share = float(again[numbers == number].mean()) if (numbers == number).any() else 0.0
        if share > MOST_SHARED:
            says = [f"{share:.0%} of its motion is in the data twice, digit by digit"]
        if says:
            culprit = "one recording copied, joined to itself, or read at another rate"
            told = f"{says[0]}: it is no test of a fit to it"
            found.append((log.name, Finding("twice", (), told, culprit, refuses=False)))
    return found


FEWEST_ROWS = 40  # measured: fewer cannot be parted into blocks that say how well a model does on others
SHORTEST = 5.0  # [s] in which no arm visits a workspace
# a wrist's cables run along its other joint: moving one alone turns the other by 16 deg on a real arm
MOVED_BY_OTHERS = {"rad": 20.0, "m": 10.0}  # [deg, mm] beyond which a measurement has a command of its own


def extent_findings(log: MotionLog) -> Iterator[Finding]:
    """Find recordings with too little in them, and columns that never change."""
    measured = int(log.ok.sum()) if log.q_encoder is not None else len(log)
    if log.q_encoder is not None and not measured:
        yield Finding("short", (), "ok is set on no row: nothing was measured")
        return
    if measured < FEWEST_ROWS:
        says = f"{measured} measured rows, expected at least {FEWEST_ROWS}"
        yield Finding("short", (), says, "a recording that was cut off")
    steps = np.diff([] if log.time is None else log.time)
    if 0.0 < (seconds := float(steps[steps > 0.0].sum())) < SHORTEST:
        says = f"{seconds:.3g} s, expected at least {SHORTEST:g}"
        yield Finding("short", (), says, "a recording that was cut off, or stamps in another unit")
    scale = scales(log)
    moved = np.ptp(scale * log.q_nominal, axis=0)
    still = [name for name, x in zip(log.joint_names, moved, strict=True) if x == 0.0]
    if (moved < MOVED).all():
        says = f"no joint was moved by more than {moved.max():.3g} deg or mm; expected {MOVED:g} or more"
        yield Finding("constant", (), says, "a recording of an arm at rest")
    elif still:
        yield Finding("constant", tuple(still), "never moved; a model holds only where it stood", refuses=False)
    if log.q_encoder is not None and log.ok.any():
        seen = scale * log.q_encoder[log.ok]
        spans = np.ptp(np.percentile(seen, [1.0, 99.0], axis=0), axis=0)
        joints = zip(log.joint_names, log.joint_units, moved, seen.T, spans, strict=True)
        for name, unit, command, column, span in joints:
            shown = DISPLAY[unit][0]
            if np.ptp(column) == 0.0 and command > MOVED:
                says = f"every measurement is {column[0]:.4g} {shown}, while the command moves by {command:.3g}"
                yield Finding("constant", (name,), says, "a channel without a sensor")
            elif command == 0.0 and span > MOVED_BY_OTHERS[unit]:
                says = f"every command is the same, while the measurement moves by {span:.3g} {shown}"
                yield Finding("constant", (name,), says, "a channel that was not recorded")
    for what, values in (("torque", log.tau), ("velocity", log.qd)):
        flat = np.zeros(len(moved), bool) if values is None else (np.ptp(values, axis=0) == 0.0) & (moved > MOVED)
        if names := tuple(name for name, same in zip(log.joint_names, flat, strict=True) if same):
            says = f"the recorded {what} never changes, while the joint moves"
            yield Finding("constant", names, says, "a channel that was not recorded", refuses=False)
