"""Does each measured joint follow its own command? Every measurement is correlated with every command."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers, spread
from catenary.verdict.command_response import Pairs, behind_slack, is_pulled, scales
from catenary.verdict.finding import Finding

# On a real wrist with 20 deg of hysteresis a measurement keeps a correlation of 0.82 with its command, and no
# other command comes near: unexplained variances are compared, and a third of them is far from chance.
_CLEAR_RATIO = 3.0
_MIN_UNEXPLAINED = 1e-3  # unexplained share that counts as none: a smaller one says nothing more
_MIN_CORRELATION = 0.5  # least correlation, of either sign, of a measurement that follows its command
_SAME_SPREAD_RATIO = 0.5  # spread of a measurement over that of its command, from which it moves on its own
_MIN_SLOPE, _MAX_UNEXPLAINED = 0.25, 0.5  # from which a measurement follows its command with slack
_MIN_SPREAD_DEG_MM = 1.0  # [deg, mm] of a motion from which a correlation is significant
_NEAR_DEG_MM = 0.5  # [deg, mm] distance between command and measurement below which nearer is no better
# of the rows, on which a measurement is its command to the last bit: no sensor agrees so well on one
_COPIED_SHARE = 0.5
_SINGLE_PRECISION = 1e-6  # of a position, to which single precision keeps it
# of a measurement's variance, that its own command leaves, where all commands together leave a tenth of it: a note
_SHARED, _SHARED_RATIO = 0.1, 10.0
# Sums were made in a file where they leave less than this of a measurement, and of its error: 53 deg of another frame
# .006, .3 of a joint .003 and .13; untouched windows of 75 poses, whose wrists' joints share friction, .017 and more.
_MAX_MIXED, _MAX_MIXED_OF_ERROR = 0.01, 0.25
_MIN_MIXED_ALONE = 0.005  # of its variance that its own command leaves: less, and a model learns it
_MIN_ROWS_A_JOINT, _MAX_ROWS = 10, 20_000
_MAX_COLLINEARITY = 30.0  # condition of commands over their spread, beyond which nothing parts their entries
_ENTRY_ERRORS, _MIN_ENTRY = 12.0, 0.05  # standard errors of such an entry, 9 where untouched; its size in deg, mm
_SHARE_OF_SUM = 0.03  # of a sum's spread, below which an entry may be what cables do
_OWN_ENTRY = 0.15  # by which a joint's own entry may differ from one without being of a frame
# from which such a difference is noted, standard errors of it, and what it leaves of the error: arms' own are smaller.
# Beside ratios of simulated RAVEN-IIs, 5 to 9 %, it is off by a sixth at most; stretch leaves up to .039 of 0 to 2.5 %
_MIN_SHARE, _SHARE_ERRORS, _MAX_SHARE_OF_ERROR, _SHARE_OFF = 0.04, 8.0, 0.6, 0.2
_MAX_CONDITION = 10.0  # of a matrix that is undone: errors of its entries grow by as much
_BLOCKS = 8


def joints_in_place(pairs: Pairs) -> Integers:
    """Return `place`: which command each measurement follows, (n,), its own unless another fits clearly better."""
    place = np.arange(len(pairs.names))
    moving = np.flatnonzero(pairs.moved & pairs.seen_moving)
    if len(moving) < 2:
        return place
    inside = np.ix_(moving, moving)
    unexplained = np.log(np.maximum(1.0 - pairs.correlation[inside] ** 2, _MIN_UNEXPLAINED))
    assigned = _assigned(unexplained)
    if (assigned == np.arange(len(moving))).all():
        # commands that move as one are distinguished by where they stand, in the same units
        units = np.array(pairs.log.joint_units)
        apart = np.array([np.median(np.abs(m[:, None] - pairs.q), axis=0) for m in pairs.m.T])
        distances = np.where(units[:, None] == units, np.log(np.maximum(apart, _NEAR_DEG_MM)), np.log(1e6))
        assigned = _assigned(distances[inside], among=unexplained)
    place[moving] = moving[assigned]
    return place


def _assigned(cost: Floats, among: Floats | None = None) -> Integers:
    """Return the assignment of least cost (logarithms), without cycles that hardly gain, or harm `among` others."""
    from scipy.optimize import linear_sum_assignment

    assigned = np.asarray(linear_sum_assignment(cost)[1], dtype=np.int64)
    for rows in map(np.array, _cycles_of(assigned)):
        gain = float(np.mean(cost[rows, rows] - cost[rows, assigned[rows]]))
        worse = among is not None and np.any(among[rows, assigned[rows]] > among[rows, rows] + np.log(1.5))
        if gain < np.log(_CLEAR_RATIO) or worse:
            assigned[rows] = rows
    return assigned


def _cycles_of(permutation: Integers) -> list[list[int]]:
    """Return the cycles of a permutation: cycle[k + 1] is where cycle[k] leads."""
    cycles, left = [], set(range(len(permutation)))
    while left:
        cycle = [min(left)]
        while (following := int(permutation[cycle[-1]])) != cycle[0]:
            cycle.append(following)
        left -= set(cycle)
        cycles.append(cycle)
    return cycles


def correspondence_findings(pairs: Pairs, place: Integers) -> tuple[list[Finding], list[Finding]]:
    """Find swapped joints; and copies, sums, flipped signs, and measurements that follow nothing."""
    findings = [*_copied(pairs), *_mixed(pairs, place)]
    explained = [
        name in {joint for finding in findings if finding.remedy for joint in finding.joints} for name in pairs.names
    ]
    for i in np.flatnonzero(pairs.moved[place] & pairs.seen_moving & ~np.array(explained)).tolist():
        r, name = float(pairs.correlation[i, place[i]]), pairs.names[i]
        spread, of_command = float(pairs.m[:, i].std()), float(pairs.q[:, place[i]].std())
        if r < _MIN_CORRELATION and is_pulled(pairs, i, place[i]):
            continue
        if r < -_MIN_CORRELATION:
            command = pairs.names[place[i]]
            says = f"the measurement falls when the command of {command} rises (correlation {r:.2f})"
            culprit = "an axis that points the other way in one of the two"
            findings.append(Finding("sign", (name,), says, culprit, f"--sign {name}"))
        elif r < _MIN_CORRELATION and spread > _SAME_SPREAD_RATIO * of_command and of_command > _MIN_SPREAD_DEG_MM:
            moves = behind_slack(pairs, i, place[i], (_MIN_SLOPE, np.inf), shared=False)
            if moves.slope > _MIN_SLOPE and moves.unexplained < _MAX_UNEXPLAINED:
                continue  # slack and other joints hide it in little motion
            says = (
                f"the measurement follows no command (correlation {r:.2f} with its own, expected above "
                f"{_MIN_CORRELATION:g}), yet moves as much ({spread:.3g} {pairs.unit(i)} RMS, "
                f"the command {of_command:.3g})"
            )
            culprit = "another joint's or another recording's column, shuffled rows, or rows far out of step"
            findings.append(Finding("unrelated", (name,), says, culprit))
    return [*_swaps(pairs, place)], findings


def _copied(pairs: Pairs) -> Iterator[Finding]:
    same = np.abs(pairs.m - pairs.q) <= _SINGLE_PRECISION * np.abs(pairs.q)
    joints = np.flatnonzero(pairs.moved & (same.mean(axis=0) > _COPIED_SHARE))
    if len(joints):
        rows = f"{same[:, joints].all(axis=1).sum()} of {len(same)} measured rows"
        culprit = "one column taken for both, or commands filled in where nothing was measured"
        names = tuple(pairs.names[i] for i in joints)
        yield Finding("copied", names, f"on {rows} the measurement is the command itself", culprit)


class _Sum(NamedTuple):
    """A measurement as a sum of commands that move, and what it leaves unexplained."""

    entries: Floats  # (k,) in SI of the measurement over SI of each command
    errors: Floats  # (k,) their standard errors
    counts: Flags  # (k,) entries that matter
    unexplained: float  # share of the measurement's variance
    of_error: float  # the same of measurement less own command


def _sum_of(pairs: Pairs, i: int, moving: Integers, *, stretched: bool = False) -> _Sum | None:
    """Explain measurement i by commands, and by what recorded torques stretch cables if `stretched`."""
    rows, tau = np.flatnonzero(pairs.likely[:, i]), pairs.log.tau if stretched else None
    if len(rows) < _MIN_ROWS_A_JOINT * len(moving):
        return None
    rows = rows[spread(len(rows), _MAX_ROWS)]
    X, y = pairs.q[np.ix_(rows, moving)], pairs.m[rows, i]
    if tau is not None:
        loads = tau[pairs.log.ok][np.ix_(rows, moving)]
        X = np.hstack([X, loads[:, np.ptp(loads, axis=0) > 0.0]])
    X, y = X - X.mean(axis=0), y - y.mean()
    # a sum holds on either half by the other; chance in slow motion does not
    late = np.arange(len(y)) >= len(y) // 2
    left = np.concatenate(
        [y[~part] - X[~part] @ np.linalg.lstsq(X[part], y[part], rcond=None)[0] for part in (late, ~late)]
    )
    # errors by leaving out blocks of rows in turn
    block = np.arange(len(y)) * _BLOCKS // len(y)
    parts = np.array([np.linalg.lstsq(X[block != b], y[block != b], rcond=None)[0] for b in range(_BLOCKS)])
    entries, errors = parts.mean(axis=0), np.sqrt(_BLOCKS - 1) * parts.std(axis=0)
    entries, errors, whole, X = entries[: len(moving)], errors[: len(moving)], X, X[:, : len(moving)]
    sizes = (float(left @ left) / max(float(x @ x), 1e-300) for x in (y, y - X[:, moving == i][:, 0]))
    if np.linalg.cond(whole / whole.std(axis=0)) > _MAX_COLLINEARITY:  # commands that move as one
        errors = np.full_like(errors, np.inf)
    to_si = scales(pairs.log)[moving] / scales(pairs.log)[i]
    return _Sum(entries * to_si, errors * to_si, np.abs(entries) * X.std(axis=0) > _SHARE_OF_SUM * y.std(), *sizes)


def _mixed(pairs: Pairs, place: Integers) -> Iterator[Finding]:
    """Find measurements that are sums of commands, their own with others', and the matrix that parts them.

    A sum in another joint's place is first put into its own.
    """
    own_place, moving, names = place == np.arange(len(place)), np.flatnonzero(pairs.moved), pairs.names
    made, shared, shown = dict[int, _Sum](), dict[int, _Sum](), scales(pairs.log)
    for i in np.flatnonzero(own_place & pairs.moved & pairs.seen_moving).tolist():
        alone, of_all = 1.0 - float(pairs.correlation[i, i]) ** 2, _sum_of(pairs, i, moving)
        if of_all is None:
            continue
        entries, errors, counts, unexplained, of_error = of_all
        least = np.maximum(_MIN_ENTRY * shown[moving] / shown[i], _ENTRY_ERRORS * errors)
        sure = counts & (moving != i) & (np.abs(entries) > least)
        is_sum = unexplained < _MAX_MIXED and of_error < _MAX_MIXED_OF_ERROR and alone > _MIN_MIXED_ALONE
        if sure.any() and counts.sum() > 1 and is_sum:
            made[i] = of_all
        elif alone > max(_SHARED, _SHARED_RATIO * unexplained):
            shared[i] = of_all
    words = "; ".join(
        f"{names[i]}: its command leaves {1.0 - pairs.correlation[i, i] ** 2:.0%} of its variance, all together "
        f"{of_all.unexplained:.1%}"
        for i, of_all in (made or shared).items()
    )
    joints, matrix, one = tuple(names[i] for i in made or shared), np.eye(len(names)), np.eye(len(names))
    if shared and not made:
        says = f"measurements follow several joints' commands ({words})"
        yield Finding("mixed", joints, says, "friction that joints share", refuses=False)
    elif made:
        rows = [(i, *row) for i, of_all in made.items() for row in zip(moving, *of_all[:3], strict=True) if row[3]]
        for i, k, entry, *_ in rows:
            matrix[i, k] = entry if k != i or abs(entry - 1.0) > _OWN_ENTRY else 1.0
        by = ", ".join(f"{names[i]}/{names[k]} {entry:.4g} +- {2.0 * error:.1g}" for i, k, entry, error, _ in rows)
        says = f"measurements are sums of commands ({words}), by {by}"
        if np.linalg.cond(matrix) > _MAX_CONDITION:
            yield Finding("mixed", joints, says, "one sum in the place of several joints, which nothing parts")
            return
        turned = _couple(matrix - one, names)
        culprit = f"motor positions, or another frame; if the robot reports these, --couple q_nominal:{turned}"
        yield Finding("mixed", joints, says, culprit, f"--couple {_couple(np.linalg.inv(matrix) - one, names)}")


def proportional_findings(pairs: Pairs) -> Iterator[Finding]:
    """Note errors that are, for a large part, a share of the joint's own motion, beside what torques stretch."""
    moving, is_loaded = np.flatnonzero(pairs.moved), pairs.log.tau is not None
    for i in np.flatnonzero(pairs.moved & pairs.seen_moving).tolist():
        of_all = _sum_of(pairs, i, moving, stretched=True)
        if of_all is None or of_all.of_error > _MAX_SHARE_OF_ERROR:
            continue
        share, error = (float(column[moving == i][0]) for column in of_all[:2])
        if max(_MIN_SHARE, _SHARE_ERRORS * error) < abs(share - 1.0) < _OWN_ENTRY:
            beside = ", beside what torques stretch" * is_loaded
            width = max(2.0 * error, _SHARE_OFF * abs(share - 1.0))
            says = f"its error holds {share - 1.0:+.3f} +- {width:.1g} of its motion{beside}"
            stretch = "" if is_loaded else "cables that stretch, "
            culprit = f"{stretch}a drum or gear of another ratio, or a wrong scale of the sensor: one recording cannot "
            yield Finding(
                "scale", (pairs.names[i],), f"{says}; a fit takes the measurement's", f"{culprit}tell which",
                refuses=False,
            )  # fmt: skip


def _couple(matrix: Floats, names: Sequence[str]) -> str:
    """Write the entries of a matrix (n, n) as `--couple` takes them."""
    return ",".join(f"{names[i]}/{names[k]}={matrix[i, k]:.4g}" for i, k in np.argwhere(np.abs(matrix) > 1e-9).tolist())


def _swaps(pairs: Pairs, place: Integers) -> Iterator[Finding]:
    names, r = pairs.names, pairs.correlation
    for cycle in (loop for loop in _cycles_of(place) if len(loop) > 1):
        says = ", ".join(
            f"measured {names[i]} follows the command of {names[place[i]]} (correlation {r[i, place[i]]:.2f}, "
            f"{r[i, i]:.2f} with its own)"
            for i in cycle
        )
        # the column at cycle[k] belongs to cycle[k + 1]: each exchange with the first puts one in place
        remedy = " ".join(f"--swap {names[cycle[0]]},{names[other]}" for other in cycle[1:])
        joints = tuple(names[i] for i in sorted(cycle))
        yield Finding("swapped", joints, says, "columns in another order", remedy)
