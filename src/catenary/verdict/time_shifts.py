"""Do the rows of commands and measurements belong together? Their delay, and larger lags along the recording."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.plant import MotionLog
from catenary.verdict.command_response import OUTLIER_SIGMAS, Pairs, in_stretches, scales
from catenary.verdict.corrections import Mend
from catenary.verdict.delay import APART_ROWS, APART_S, CERTAIN_SIGMAS, LOOKS, Delay, delay_of, reach_of
from catenary.verdict.finding import Finding

# Lags beyond what `delay_of` looks at, by cross-correlation. Hysteresis looks like a lag: at most half of what a wrist
# leaves unexplained is gone a row later; rows out of step leave 3 to 9000 times as much on a real arm's tight joints.
_CLEAR_RATIO = 3.0
_MAX_LAG_ROWS = 64  # that the two are moved against each other
_MAX_LAG_S = 2.0  # [s] the lag that is looked for where rows are dense: cables, filters and networks lag under one
_WINDOWS = 6  # along the recording
_MIN_WINDOW_ROWS = 200  # rows of a window, below which there is one
_MOVED_DEG_MM = 5.0  # [deg, mm] least range of a joint within a window
_MIN_CLEAR_WINDOWS = 3  # in which a lag must be clear to separate two clocks from one shift
_MAX_PAIRS = 3000  # rows that a lag is judged by
_MIN_UNEXPLAINED = 1e-6  # unexplained, that counts as none
_APART_LAG_ROWS = 3  # rows by which lags must differ along the recording
# deviations by which joints with delays of their own are noted, and refused; untouched arms' stray by up to 2.4, and a
# made joint whose friction turns at once by 3.2; a slack elbow .3 s late, by 3.8
_DOUBTED_SIGMAS, _UNLIKE_SIGMAS = 3.3, 3.6
# times more unexplained variance, that rows in step may leave a joint: early rows cancel its hysteresis
_WORSE_RATIO = 1.3


def delay_findings(pairs: Pairs, place: Integers) -> list[Finding]:
    """Find measurements that lie a time before or after their commands; there is always one finding or more."""
    log, apart = pairs.log, list[Finding]()
    if log.q_reported is not None:  # what a controller does between the two is no delay of a clock
        own = delay_of(replace(log, q_encoder=log.q_reported, ok=np.ones(len(log), dtype=bool)))
        log = replace(log, q_nominal=log.q_reported)
        says = f"reported positions lag their setpoints by {own.seconds:+.3f} {own.unit}"
        between = f"between {own.low:+.3f} and {own.high:+.3f} {own.unit}"
        culprit = "the controller's lag; the delay is relative to the report"
        apart = [Finding("lag", (), f"{says}, {between}", culprit, refuses=False)] * (own.sure != "unknown")
    near = delay_of(log, place)
    known = None if near.sure == "unknown" else near
    unlike = _unlike(log, place, near)
    others = [finding for finding in _common_findings(log, place, near, known) if finding.refuses or not unlike.refuses]
    if unlike.refuses and abs(near.median) > (APART_S if near.unit == "s" else APART_ROWS) and not others:  # of most
        others = [_delay(replace(near, seconds=near.median, sure="certain"))]
    return [*apart, *others, *[unlike] * (near.apart_by > _DOUBTED_SIGMAS)]


def _unlike(log: MotionLog, place: Integers, near: Delay) -> Finding:
    """Return the finding on joints with delays of their own; its mend, if rows are then as in step as clean ones."""
    own, remedy, refuses = dict(near.apart), "", near.apart_by > _UNLIKE_SIGMAS
    each = ", ".join(f"{seconds:+.2f}" for seconds in own.values())
    says = f"measurements lie {each} {near.unit} behind commands, those of all joints together {near.seconds:+.2f}"
    late = {joint: seconds - near.median for joint, seconds in own.items() if abs(seconds - near.median) >= APART_S}
    if refuses and near.unit == "s" and late:
        clocks = tuple(f"{joint}={seconds:.3f}" for joint, seconds in late.items())
        again = delay_of(Mend(clock=clocks)(log), place, about=near.median)
        if again.apart_by <= _DOUBTED_SIGMAS and again.cost < near.cost:
            remedy = " ".join(f"--clock {clock}" for clock in clocks)
            left = {joint: (low + late[joint], high + late[joint]) for joint, low, high in again.alone if joint in late}
            says += f" ({', '.join(f'{joint} {low:+.2f} to {high:+.2f}' for joint, (low, high) in left.items())})"
    culprit = "sensors with clocks of their own; or, where q_nominal is a setpoint, joints that lag unlike"
    known = None if near.sure == "unknown" else near
    return Finding("clock", tuple(own), f"{says}, expected the same", culprit, remedy, refuses, known)


def _common_findings(log: MotionLog, place: Integers, near: Delay, known: Delay | None) -> list[Finding]:
    """Find one delay of all joints; there is always one finding or more."""
    from scipy.stats import spearmanr

    if change := near.change[0]:
        ppm, low, high = (1e6 * rate for rate in near.rate)
        says = (
            f"the delay grows by {change:+.3g} {near.unit} along the recording, {ppm:.0f} ppm ({low:.0f} to {high:.0f})"
        )
        apart = replace(_clock(says, near), remedy=f"--clock {near.at_first:.4f},{ppm:.1f}")
        return [apart, *[replace(_delay(near), remedy="")] * (near.sure == "certain")]
    clocks: list[Finding] = []
    if near.sure == "certain":
        return [_delay(near)]
    step = 0.0 if log.time is None or len(log) < 2 else float(np.median(np.diff(log.time)))
    stride = (
        max(1, round(_MAX_LAG_S / _MAX_LAG_ROWS / step)) if step > 0.0 else 1
    )  # _MAX_LAG_ROWS steps reach _MAX_LAG_S
    count = _WINDOWS if len(log) >= _WINDOWS * _MIN_WINDOW_ROWS else 1
    edges = np.linspace(0, len(log), count + 1).astype(int)
    lags = [_lag(log, place, slice(a, b), stride) for a, b in pairwise(edges)]
    clear = [lag for lag in lags if lag]
    if (
        len(clear) >= _MIN_CLEAR_WINDOWS
        and np.ptp(lags) >= _APART_LAG_ROWS * stride
        and abs(spearmanr(range(count), lags)[0]) > 0.8
    ):
        along = ", ".join(str(lag) for lag in lags)
        clocks = [_clock(f"the measurement lags the command by {along} rows in {count} equal parts", known)]
    lag = _lag(log, place, slice(0, len(log)), stride) or (int(np.median(clear)) if len(clear) > count // 2 else 0)
    if lag:
        # poses that rest for unlike times, or have no stamps that differ, are out of step by rows, not by seconds
        far = delay_of(replace(log, time=None), place, about=float(lag))
        reach, rows = reach_of(log)
        if rows:
            in_time = delay_of(log, place, about=lag * reach / rows)
            far = far if far.cost < in_time.cost - 1.0 else in_time
        if far.cost < near.cost - CERTAIN_SIGMAS**2 / LOOKS:
            return [*clocks, _delay(far)]
    elif clear and not clocks:
        parts = ", ".join(str(i + 1) for i, each in enumerate(lags) if each)
        behind = ", ".join(str(delay) for delay in clear)
        clocks = [_clock(f"in part {parts} of {count} the measurement lags the command by {behind} rows", known)]
    return clocks or [Finding("delay", (), str(near), refuses=False, delay=known)]


def _delay(delay: Delay) -> Finding:
    setpoint = "where q_nominal is a setpoint, the controller's lag (q_reported tells them apart)"
    late, early = f"stamps of arrival; or, {setpoint}", "commands stamped late, or measurements too early"
    remedy = f"--delay {delay.seconds:.3g}" if delay.unit == "s" else f"--shift {round(delay.seconds)}"
    return Finding("delay", (), str(delay), late if delay.seconds > 0.0 else early, remedy, delay=delay)


def _clock(says: str, delay: Delay | None) -> Finding:
    expected = f"{says}, expected the same everywhere"
    return Finding("clock", (), expected, "two clocks that run apart, or rows that one of the two lost", delay=delay)


def _lag(log: MotionLog, place: Integers, part: slice, stride: int) -> int:
    """Return the delay of a part's measurement in rows; 0 unless clear, and larger than near."""
    assert log.q_encoder is not None
    scale = scales(log)
    q, m, ok = (scale * log.q_nominal)[part], (scale * log.q_encoder)[part], log.ok[part]
    joints = [i for i in range(len(place)) if np.ptp(q[:, place[i]]) > _MOVED_DEG_MM]
    reach = min(_MAX_LAG_ROWS, len(q) // (8 * stride))
    if not joints or reach < 1 or ok.sum() < 8:
        return 0
    lags = stride * np.arange(-reach, reach + 1)
    time = None if log.time is None else log.time[part]
    costs = np.column_stack([_unexplained(q[:, place[i]], m[:, i], ok, lags, time) for i in joints])
    gains = costs[reach] - costs  # (lags, joints), logarithms
    mean = gains.mean(axis=1)
    best = int(np.argmax(mean))
    at_the_end = best in (0, len(lags) - 1) and len(q) < len(log)  # of the search in a part: it goes on beyond
    clear = mean[best] >= np.log(_CLEAR_RATIO) and (gains[best] >= -np.log(_WORSE_RATIO)).all()
    if at_the_end or not clear or abs(lags[best]) <= reach_of(log)[1]:
        return 0
    return int(lags[best])


def _unexplained(command: Floats, measured: Floats, ok: Flags, lags: Integers, time: Floats | None) -> Floats:
    """Return logarithms of the share of a measurement's variance that commands each lag earlier leave, (lags,)."""
    apart = measured[ok] - command[ok]
    away = np.abs(apart - np.median(apart))
    rows = np.flatnonzero(ok)[away <= OUTLIER_SIGMAS * max(1.4826 * float(np.median(away)), 1.0)]
    rows = in_stretches(rows, _MAX_PAIRS, command, time)
    left = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        inside = rows[max(0, np.searchsorted(rows, lag)) : np.searchsorted(rows, len(command) + min(0, lag))]
        if not len(inside):
            continue
        x, y = command[inside - lag], measured[inside]
        x, y = x - x.mean(), y - y.mean()
        size = float(x @ x) * float(y @ y)
        left[k] = np.log(max(1.0 - float(x @ y) ** 2 / size, _MIN_UNEXPLAINED)) if size > 0.0 else 0.0
    return left
