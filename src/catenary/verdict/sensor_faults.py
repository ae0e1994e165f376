"""Did the sensors measure? Stuck encoders, rows of zeros, single wild measurements."""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.plant import GAP_STEPS, MotionLog
from catenary.units import DISPLAY
from catenary.verdict.command_response import OUTLIER_SIGMAS, Pairs, outliers, play, scales, slack_of
from catenary.verdict.finding import Finding

# A joint behind slack repeats its number to the last bit at every reversal, until its motor has taken the slack up: as
# far as the errors of the rows on which it moves lie apart, which are those of both ways through the slack.
_SLACK_RATIO = 1.5  # times that far a command moves before a measurement that repeats itself is stuck
_RANGE_SHARE = 0.1  # of a command's range that it moves too: a coarse encoder repeats itself in slow motion
_MIN_STUCK_ROWS = 10  # of such a stretch
_MIN_RANGE_DEG_MM = 5.0  # [deg, mm] of a command from which a measurement must move with it
_FROZEN_COMMAND_SHARE = 0.6  # of a command's range, passed while the measurement all but stands
_FROZEN_MOTION_SHARE = 0.03  # of the command's motion that counts as standing: no slack takes 97 % of so long a way
_WINDOW_ROWS = (20, 100, 400)  # rows
# of the rows: fewer that stand still are, like outliers, no reason to refuse the others; a real arm stalled on 1.8 %
_FEW_STUCK_SHARE = 0.02
_SAME_ROWS_SHARE = 0.5  # of the rows, on which joints stand still together
_SINGLE_FAILURES_SHARE = 0.1  # of the errors: more are no single failures, such as those on the rarer side of slack
_MAX_SHOWN, _MAX_MENDED = 4, 40  # stretches that a message lists, and that its remedy does
# of the rows that repeat all of the last measurement, and of what a command moves in the others: encoders repeat
# themselves where the arm is slow, a slow sensor's last reading is repeated at any speed
_HELD_SHARE, _HELD_SPEED_RATIO = 0.1, 0.5
_COARSE_DEG_MM = 0.05  # [deg, mm] RMS of rounding that is worth a word
_MISSING_SHARE = 0.03  # of the rows without a measurement: fewer hide little
# times what 95 % lie below, the largest errors, mean of joints: 1.01 to 1.2 where cut, else 1.22 and more
_SHARP_RATIO = 1.2
# of pairs of a row with a measurement and one without, that motion tells apart; chance is half
_SEPARATED_SHARE = 0.75
_ABSENT_STEPS = 1.75  # usual steps between stamps, from which rows are absent between
_SMOOTH_SHARE = 0.5  # share of the way between rows that these may be off a straight line, for absent ones to lie there
_TINY_COMMAND_SI = 1e-6  # [rad, m] of a command that is not zero
_CATCH_UP_RATIO = 1.5  # times a command's step, by which the reading after a held one steps; not so behind slack
# [rad, m] within which three rows lie on a line: of six digits or single precision, of double
_ON_LINE_SI = 1e-6, 1e-11
_OFF_LINE_RATIO = 100.0  # times as far that the median of other rows lies off: noise-free motion is bent evenly
# share of the rows that were filled in, and rows of a gap: one alone lies so by chance
_FILLED_SHARE, _MIN_FILLED_ROWS = 0.03, 2


def sensor_findings(pairs: Pairs, place: Integers) -> tuple[list[Finding], Flags]:
    """Find measurements that stand still while their joint is moved, and the log's rows on which too many do (N,)."""
    stuck: list[tuple[list[int], Flags]] = []  # joints that stand still on the same rows, these rows
    for i in range(len(pairs.names)):
        command, measured = pairs.q[:, place[i]], pairs.m[:, i]
        reach = float(np.ptp(np.percentile(command, [1.0, 99.0])))
        if reach < _MIN_RANGE_DEG_MM:
            continue
        slack = _SLACK_RATIO * slack_of(command, measured)
        still = _repeated(command, measured, max(_RANGE_SHARE * reach, slack))
        frozen = _frozen(command, measured, _FROZEN_COMMAND_SHARE * reach)
        if frozen.any() and not frozen.all():  # how far slack reaches, the other rows tell
            slack = _SLACK_RATIO * slack_of(command[~frozen], measured[~frozen])
            frozen &= _frozen(command, measured, max(_FROZEN_COMMAND_SHARE * reach, slack))
        still |= frozen
        if not still.any():
            continue
        for joints, rows in stuck:
            if (still & rows).sum() > _SAME_ROWS_SHARE * (still | rows).sum():
                joints.append(i)
                rows |= still
                break
        else:
            stuck.append(([i], still))
    findings, lost = [_stuck(pairs, joints, rows) for joints, rows in stuck], np.zeros(len(pairs.log), dtype=bool)
    for each, (_, rows) in zip(findings, stuck, strict=True):
        lost[np.flatnonzero(pairs.log.ok)[rows & each.refuses]] = True
    return findings or _held(pairs), lost


def _held(pairs: Pairs) -> list[Finding]:
    """Note readings that are written again and again until the next one comes."""
    moved = np.abs(np.diff(pairs.q, axis=0)).max(axis=1)
    repeats = (np.diff(pairs.m, axis=0) == 0.0).all(axis=1) & (moved > 0.0)
    new = ~repeats & (moved > 0.0)
    caught_up = new & np.concatenate([[False], repeats[:-1]])
    if (
        repeats.mean() < _HELD_SHARE
        or not caught_up.any()
        or np.median(moved[repeats]) < _HELD_SPEED_RATIO * np.median(moved[new])
    ):
        return []
    jumps = np.abs(np.diff(pairs.m, axis=0)).max(axis=1)[caught_up]
    if np.median(jumps) < _CATCH_UP_RATIO * np.median(moved[caught_up]):
        return []
    says = (
        f"{int(repeats.sum())} of {len(pairs.m)} measured rows repeat the measurement before, on every joint, while "
        "the commands move; expected ok to be set where something was measured"
    )
    culprit = "a sensor slower than the recorder, whose last reading was written again"
    return [Finding("stuck", (), says, culprit, refuses=False)]


def filled_findings(log: MotionLog) -> list[Finding]:
    """Note measurements on straight lines between others, or equal to commands that bend: gaps that somebody filled."""
    rows = np.flatnonzero(log.ok)
    if log.q_encoder is None or len(rows) < _WINDOW_ROWS[0]:
        return []
    q, m = (x if len(rows) == len(x) else x[rows] for x in (log.q_nominal, log.q_encoder))
    fine = [j for j, x in enumerate(m.T) if _step_of(x) is None]  # on a grid, three rows lie on lines often
    stamps = [rows.astype(float), *([] if log.time is None else [log.time[rows]])]
    m = m[:, fine] if len(fine) < m.shape[1] else m
    moves = _largest((x[2:] - x[:-2] for x in m.T), len(m) - 2)
    ways = [("are on straight lines between others", _off_lines(m, at), _off_lines(q, at)) for at in stamps]
    off = _largest(((x - q[:, j])[1:-1] for x, j in zip(m.T, fine, strict=True)), len(m) - 2)
    ways.append(("are the commands themselves", off, ways[0][2]))
    for (what, away, bent), line in itertools.product(ways, _ON_LINE_SI):
        on, bends = (away <= line) & (moves > 10.0 * line), bent > 10.0 * line
        stretches = [(a, b) for a, b in _stretches(on) if b - a >= _MIN_FILLED_ROWS and bends[a:b].any()]
        count = sum(b - a for a, b in stretches)
        if count > _FILLED_SHARE * len(on) and np.median(np.r_[0.0, away[away > line]]) > _OFF_LINE_RATIO * line:
            says = (
                f"{count} of {len(rows)} measurements {what}, while the commands bend; expected ok to be set "
                "where something was measured: errors printed here hold these rows too"
            )
            culprit = "gaps filled by interpolation or with commands, or a slower sensor's readings up-sampled"
            remedy = f"--leave-out {','.join(f'{rows[a + 1]}:{rows[b] + 1}' for a, b in stretches)}"
            return [Finding("filled", (), says, culprit, remedy * (len(stretches) <= _MAX_MENDED), refuses=False)]
    return []


def _off_lines(x: Floats, at: Floats) -> Floats:
    """Return the distance of rows (N, n) from the lines between their neighbours, the largest column, (N - 2,)."""
    whole = at[2:] - at[:-2]
    share = np.divide(at[1:-1] - at[:-2], whole, out=np.full(len(whole), np.nan), where=whole > 0.0)
    return _largest((column[1:-1] - (1.0 - share) * column[:-2] - share * column[2:] for column in x.T), len(share))


def _largest(columns: Iterable[Floats], rows: int) -> Floats:
    """Return the largest magnitude over columns, (N,): one at a time, so that long recordings need little memory."""
    largest = np.zeros(rows)
    for column in columns:
        np.maximum(largest, np.abs(column), out=largest)
    return largest


def _stuck(pairs: Pairs, joints: list[int], still: Flags) -> Finding:
    measured_rows = np.flatnonzero(pairs.log.ok)
    stretches = [(measured_rows[a], measured_rows[b - 1] + 1) for a, b in _stretches(still)]
    shown = ", ".join(f"{a} to {b - 1}" for a, b in stretches[:_MAX_SHOWN])
    more = f" and {len(stretches) - _MAX_SHOWN} more" if len(stretches) > _MAX_SHOWN else ""
    says = (
        f"the measurement freezes on {int(still.sum())} of {len(still)} measured rows, {still.mean():.1%} of them "
        f"({shown}{more}), while the commands move beyond any slack that the other rows show"
    )
    alone = len(joints) == 1
    culprit = "a stuck or unplugged encoder" if alone else "a camera that held its last picture, or an arm that stopped"
    remedy = f"--leave-out {','.join(f'{a}:{b}' for a, b in stretches)}" if len(stretches) <= _MAX_MENDED else ""
    refuses = bool(still.mean() > _FEW_STUCK_SHARE)
    return Finding("stuck", tuple(pairs.names[i] for i in joints), says, culprit, remedy, refuses)


def _stretches(rows: Flags) -> list[tuple[int, int]]:
    """Return first rows and the ones after the last of stretches that are set."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _repeated(command: Floats, measured: Floats, least: float) -> Flags:
    """Return rows of stretches with the same measurement during which the command moved by `least`."""
    still = np.zeros(len(measured), dtype=bool)
    bounds = np.flatnonzero(np.diff(measured) != 0.0) + 1
    edges = np.concatenate([[0], bounds, [len(measured)]])
    long = np.flatnonzero(np.diff(edges) >= _MIN_STUCK_ROWS)
    for first, last in zip(edges[long], edges[long + 1], strict=True):
        if np.ptp(command[first:last]) >= least:
            still[first:last] = True
    return still


def _frozen(command: Floats, measured: Floats, least: float) -> Flags:
    """Return rows of windows in which the measurement hardly moves while the command moves by `least`."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    frozen = np.zeros(len(command), dtype=bool)
    for width in (w for w in _WINDOW_ROWS if w < len(command)):
        # windows from row k on, as the filters' are about row k + width // 2
        inside = slice(width // 2, len(command) - (width - 1) // 2)
        ranges = [(maximum_filter1d(x, width) - minimum_filter1d(x, width))[inside] for x in (command, measured)]
        begins = np.flatnonzero((ranges[0] >= least) & (ranges[1] < _FROZEN_MOTION_SHARE * ranges[0]))
        edges = np.zeros(len(command) + 1, dtype=np.int64)
        np.add.at(edges, begins, 1)
        np.add.at(edges, begins + width, -1)
        frozen |= np.cumsum(edges[:-1]) > 0
    return frozen


def _step_of(x: Floats) -> float | None:
    """Return the step of numbers on a grid, such as an encoder's count; None of others."""
    steps = np.diff(np.unique(np.round(x, 9)))
    step = float(np.median(steps)) if len(steps) else 0.0
    return step if step and (np.abs(steps / step - np.round(steps / step)) < 0.01).mean() > 0.99 else None


def coarse_findings(pairs: Pairs) -> Iterator[Finding]:
    """Note measurements in steps so coarse that errors are those of rounding."""
    for i, name in enumerate(pairs.names):
        step = _step_of(pairs.m[:, i])
        if step is not None and step / np.sqrt(12.0) > _COARSE_DEG_MM:
            says = (
                f"measurements come in steps of {step:.3g} {pairs.unit(i)}: rounding alone causes errors of "
                f"{step / np.sqrt(12.0):.2g} {pairs.unit(i)} RMS, part of every error printed here"
            )
            yield Finding("coarse", (name,), says, "a coarse encoder, or few digits", refuses=False)


def missing_findings(log: MotionLog) -> list[Finding]:
    """Note rows without a measurement whose motion differs from the others: nobody knows the errors there.

    The motion tells them apart, or the errors next to them; or errors of the others end sharply on all joints, as where
    rows were cut out by them, which on a joint or two slack does too. Stamps tell of rows that are absent, too.
    """
    commands, missing = _every_row(log)
    if not _MISSING_SHARE < missing.mean() < 1.0 - _MISSING_SHARE:
        return []
    q = commands / np.maximum(np.ptp(commands, axis=0), 1e-12)
    speed = np.gradient(q, axis=0)
    speed = speed / np.maximum(np.abs(speed).max(axis=0), 1e-12)
    held = [play(np.ascontiguousarray(x), 0.03) - x for x in q.T]  # which side of its slack a joint is on
    X = np.column_stack([np.ones(len(q)), q, q**2, np.abs(speed), np.sign(speed), *held])
    share = _separation(X @ np.linalg.lstsq(X, missing.astype(float), rcond=None)[0], missing)
    how = [f"motion separates them in {share:.0%} of pairs"] if share >= _SEPARATED_SHARE else []
    if log.q_encoder is not None and q.shape[1] > 2:
        errors = (log.q_encoder - log.q_nominal)[log.ok]
        away = np.abs(errors - np.median(errors, axis=0))
        usual = np.maximum(np.quantile(away, 0.95, axis=0), 1e-12)
        if log.ok.all():  # rows that are absent singly: errors there are about those of their neighbours
            size = np.interp(np.arange(len(q)), np.flatnonzero(~missing), np.linalg.norm(away / usual, axis=1))
            if (near_errors := _separation(size, missing)) >= _SEPARATED_SHARE:
                how.append(f"errors next to them are larger in {near_errors:.0%} of pairs")
        else:
            times = float(np.exp(np.mean(np.log(np.maximum(away.max(axis=0) / usual, 1.0)))))
            if times < _SHARP_RATIO:
                how.append(f"errors of the others end sharply, {times:.2f} times beyond where 95% lie")
    if not how:
        return []
    says = (
        f"the {missing.mean():.0%} of rows without a measurement are not like the others ({'; '.join(how)}): errors "
        "printed here are those of the rows measured"
    )
    return [Finding("missing", (), says, "a sensor that fails in some motions, or rows cut out", refuses=False)]


def _separation(score: Floats, missing: Flags) -> float:
    """Return the share of pairs of a missing row and another in which the missing one's score is larger."""
    order = np.argsort(np.argsort(score))
    return float((order[missing].mean() - (missing.sum() - 1) / 2.0) / (~missing).sum())  # Mann and Whitney's share


def _every_row(log: MotionLog) -> tuple[Floats, Flags]:
    """Return commands of all rows, those that stamps show to be absent included, and which have no measurement."""
    steps = np.diff([] if log.time is None else log.time)
    counted = steps / np.median(steps[steps > 0.0]) if (steps > 0.0).any() else np.zeros(0)
    # steps of untouched recordings go up to 1.7 usual ones; across longer gaps commands are not known
    absent = np.where((counted > _ABSENT_STEPS) & (counted < GAP_STEPS), np.rint(counted) - 1.0, 0.0).astype(int)
    if not absent.any():
        return log.q_nominal, ~log.ok
    q = log.q_nominal / np.maximum(np.ptp(log.q_nominal, axis=0), 1e-12)
    off, way = np.diff(q, n=2, axis=0) / 2.0, np.diff(q, axis=0)  # of a row that lay halfway between its neighbours
    if np.linalg.norm(off) > _SMOOTH_SHARE * np.linalg.norm(way):
        return log.q_nominal, ~log.ok
    after = np.repeat(np.arange(len(steps)), absent + 1)  # the row that each one follows, or is
    share = (np.arange(len(after)) - np.searchsorted(after, after)) / (absent + 1)[after]
    between = (1.0 - share)[:, None] * log.q_nominal[after] + share[:, None] * log.q_nominal[after + 1]
    measured = np.append((share == 0.0) & log.ok[after], log.ok[-1])
    return np.vstack([between, log.q_nominal[-1:]]), ~measured


def zero_findings(log: MotionLog) -> list[Finding]:
    """Find rows whose measurement is zero on every joint, though they are said to be measured."""
    if log.q_encoder is None:
        return []
    zero = log.ok & (log.q_encoder == 0.0).all(axis=1) & (log.q_nominal != 0.0).any(axis=1)
    others = log.ok & ~zero
    if others.any():  # a joint that is measured in coarse steps does pass zero
        usual = np.percentile(np.abs(log.q_encoder - log.q_nominal)[others], 95.0, axis=0)
        zero &= (np.abs(log.q_nominal) > 2.0 * usual + _TINY_COMMAND_SI).any(axis=1)
    count = int(zero.sum())
    if not count:
        return []
    says = (
        f"{count} of {int(log.ok.sum())} measured rows are zero on every joint, the first at row "
        f"{int(np.flatnonzero(zero)[0])}; expected ok to be false where nothing was measured"
    )
    return [Finding("zeros", (), says, "a sensor that saw nothing", _max_error(log, ~zero & log.ok))]


def outlier_findings(log: MotionLog) -> Iterator[Finding]:
    """Note measurements far from all others, with limits that would leave them out."""
    if log.q_encoder is None or log.ok.sum() < 3:
        return
    errors = scales(log) * (log.q_encoder - log.q_nominal)[log.ok]
    for name, unit, count, spread in zip(log.joint_names, log.joint_units, *outliers(errors), strict=True):
        far = f"{OUTLIER_SIGMAS:g} robust standard deviations ({_plain(OUTLIER_SIGMAS * spread)} {DISPLAY[unit][0]})"
        says, few = f"{count} of {len(errors)} errors lie beyond {far}", count < _SINGLE_FAILURES_SHARE * len(errors)
        culprit = "measurement failures" if few else "the other side of slack"
        if count:
            yield Finding("outliers", (name,), says, culprit, _max_error(log, log.ok) if few else "", refuses=False)


def _max_error(log: MotionLog, rows: Flags) -> str:
    """Return limits beyond which errors are no errors of these rows: OUTLIER_SIGMAS about each joint's median."""
    assert log.q_encoder is not None
    if not rows.any():
        return "--max-error"
    errors = scales(log) * (log.q_encoder - log.q_nominal)[rows]
    far = np.abs(np.median(errors, axis=0)) + OUTLIER_SIGMAS * np.maximum(outliers(errors)[1], 0.1)
    return f"--max-error {','.join(_plain(limit) for limit in far)}"


def _plain(limit: float) -> str:
    """Return two digits of a number, without an exponent."""
    return np.format_float_positional(limit, precision=2, unique=False, fractional=False, trim="-")
