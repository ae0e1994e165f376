"""Are time stamps in seconds, each once, and rising?"""

import numpy as np

from catenary.plant import MotionLog
from catenary.verdict.command_response import scales
from catenary.verdict.delay import Delay
from catenary.verdict.finding import Finding

_MOVED_DEG_MM = 5.0  # [deg, mm] range from which a joint's speed is looked at
_MAX_CROSSING_S = 600.0  # [s] for the fastest joint to cross its range at its median speed; slow real ones need 10
_MAX_STEP_S = 60.0  # [s] a median step that no recording has
_MAX_SPEEDS = {"rad": 3000.0, "m": 10000.0}  # [deg/s, mm/s] that no arm reaches; RAVEN-II's tool turns at 500
_MIN_PART_ROWS = 20  # median length of the parts between stamps that go back: joined recordings are longer
_REPEATED_SHARE = 0.01  # share of rows with a stamp that was there before: messages that came twice are fewer
_LEAPING_SHARE = 0.1  # of rows, on which commands change, of a staircase
_MIN_STEPS_BACK = 4  # from which that is asked: a clock may be set once or twice


def stamp_findings(log: MotionLog, *, in_si: bool = True) -> list[Finding]:
    """Return findings about stamps that repeat, are shuffled, or are not in s.

    Args:
        in_si: Whether positions are in SI, so that speeds can tell the unit of time.
    """
    if log.time is None:
        return []
    findings = []
    steps = np.diff(log.time)
    repeated, back = int((steps == 0.0).sum()), int((steps < 0.0).sum())
    if repeated or log.repeated > _REPEATED_SHARE * (len(log) + log.repeated):
        count, rows = repeated + log.repeated, len(log) + log.repeated
        says = f"{count} repeated time stamps in {rows} rows; expected a different stamp for every row"
        culprit = "rows written twice, a sensor slower than the recorder, or a clock of coarse steps"
        findings.append(Finding("stamps", (), says, culprit))
    if back >= _MIN_STEPS_BACK:
        lengths = np.diff([*log.starts, len(log)])
        if np.median(lengths) < _MIN_PART_ROWS:
            says = f"time goes back {back} times, every {np.median(lengths):.0f} rows; expected it to rise"
            culprit = "rows that were shuffled, or merged from two clocks"
            findings.append(Finding("stamps", (), says, culprit))
    return [*findings, *_unit_findings(log)] if in_si and not findings else findings


def arrival_findings(log: MotionLog, delay: Delay | None) -> list[Finding]:
    """Note measurements stamped another time before their arrival than commands, and what their delay says of it.

    Stamps of a clock that is behind by c lie c too early: measurements then lead by c. A longer way leaves them right.
    """
    if not {"q_nominal", "q_encoder"} <= set(log.arrivals):
        return []
    (own, step), (seen, other) = log.arrivals["q_nominal"], log.arrivals["q_encoder"]
    apart = seen - own
    if abs(apart) <= max(step, other):
        return []
    culprit = "two different clocks, or a slower path to the recorder; the motion cannot distinguish them"
    if delay is not None and delay.unit == "s":
        by_clock, by_way = delay.low <= -apart <= delay.high, delay.low <= 0.0 <= delay.high
        if by_clock and not by_way:
            culprit = "two clocks that differ by that: the motion shows it"
        elif by_way and not by_clock:
            culprit = "a slower path to the recorder: the motion shows no such delay, and the stamps are right"
    says = f"measurements are stamped {seen:.3f} s before their arrival, commands {own:.3f} s"
    return [Finding("clock", (), says, culprit, refuses=False)]


def count_poses(log: MotionLog) -> int:
    """Return between how many poses commands leap, to stand there; 0 where they move."""
    moves = np.any(np.diff(log.q_nominal, axis=0) != 0.0, axis=1)
    padded = np.r_[False, moves, False]
    leaps = moves & ~padded[:-2] & ~padded[2:]
    return 1 + int(leaps.sum()) if 0.0 < moves.mean() < _LEAPING_SHARE and leaps.sum() > 0.9 * moves.sum() else 0


def _unit_findings(log: MotionLog) -> list[Finding]:
    assert log.time is not None
    steps = np.diff(log.time)
    rising = steps > 0.0
    if not rising.any() or count_poses(log):  # a leap takes no time
        return []
    q, median = scales(log) * log.q_nominal, float(np.median(steps[rising]))
    moved, ranges = np.abs(np.diff(q, axis=0))[rising], np.ptp(q, axis=0)
    speed = moved / steps[rising][:, None]  # [deg/s, mm/s]
    crossing, quick = [], []
    for j, unit in enumerate(log.joint_units):
        if ranges[j] > _MOVED_DEG_MM and len(going := speed[moved[:, j] > 0.0, j]):
            crossing.append(float(ranges[j] / np.median(going)))
            quick.append(float(np.median(going)) / _MAX_SPEEDS[unit])
    if not crossing:
        return []
    if median > _MAX_STEP_S or min(crossing) > _MAX_CROSSING_S:
        says = (
            f"a median step of {median:.4g} s, and {min(crossing):.4g} s for the fastest joint to cross its range; "
            f"expected less than {_MAX_STEP_S:g} s and {_MAX_CROSSING_S:g} s"
        )
        return [Finding("stamps", (), says, "stamps in ms, us or ns", "--time-unit ms")]
    if max(quick) > 1.0:
        says = f"a median step of {median:.4g} s makes joints {max(quick):.3g} times faster than any arm"
        culprit = "stamps in another unit than s (minutes, thousands of s)"
        return [Finding("stamps", (), says, culprit, "--time-unit min")]
    return []
