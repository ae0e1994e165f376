"""Is there enough to learn from? Rows, seconds, motion, columns that never change."""

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog
from catenary.units import DISPLAY
from catenary.verdict.finding import Finding
from catenary.verdict.pairs import MOVED, scales

FEWEST_ROWS = 40  # measured: fewer cannot be parted into blocks that say how well a model does on others
SHORTEST = 5.0  # [s] in which no arm visits a workspace
# a wrist's cables run along its other joint: moving one alone turns the other by 16 deg on a real arm
MOVED_BY_OTHERS = {"rad": 20.0, "m": 10.0}  # [deg, mm] beyond which a measurement has a command of its own


def extent_findings(log: MotionLog) -> list[Finding]:
    """Find recordings with too little in them, and columns that never change."""
    findings = []
    measured = int(log.ok.sum()) if log.q_encoder is not None else len(log)
    if log.q_encoder is not None and not measured:
        return [Finding("short", (), "ok is set on no row: nothing was measured")]
    if measured < FEWEST_ROWS:
        says = f"{measured} measured rows, expected at least {FEWEST_ROWS}"
        findings.append(Finding("short", (), says, "a recording that was cut off"))
    steps = np.diff([] if log.time is None else log.time)
    if 0.0 < (seconds := float(steps[steps > 0.0].sum())) < SHORTEST:
        says = f"{seconds:.3g} s, expected at least {SHORTEST:g}"
        findings.append(Finding("short", (), says, "a recording that was cut off, or stamps in another unit"))
    scale = scales(log)
    moved = np.ptp(scale * log.q_nominal, axis=0)
    still = [name for name, x in zip(log.joint_names, moved, strict=True) if x == 0.0]
    if (moved < MOVED).all():
        says = f"no joint was moved by more than {moved.max():.3g} deg or mm; expected {MOVED:g} or more"
        findings.append(Finding("constant", (), says, "a recording of an arm at rest"))
    elif still:
        says = "never moved; a model holds only where it stood"
        findings.append(Finding("constant", tuple(still), says, refuses=False))
    findings += _constant_columns(log, moved)
    return findings


def _constant_columns(log: MotionLog, moved: Floats) -> list[Finding]:
    findings = []
    scale = scales(log)
    if log.q_encoder is not None and log.ok.any():
        measured = scale * log.q_encoder[log.ok]
        spans = np.ptp(np.percentile(measured, [1.0, 99.0], axis=0), axis=0)
        joints = zip(log.joint_names, log.joint_units, moved, measured.T, spans, strict=True)
        for name, unit, command, column, span in joints:
            shown = DISPLAY[unit][0]
            if np.ptp(column) == 0.0 and command > MOVED:
                says = f"every measurement is {column[0]:.4g} {shown}, while the command moves by {command:.3g}"
                findings.append(Finding("constant", (name,), says, "a channel without a sensor"))
            elif command == 0.0 and span > MOVED_BY_OTHERS[unit]:
                says = f"every command is the same, while the measurement moves by {span:.3g} {shown}"
                findings.append(Finding("constant", (name,), says, "a channel that was not recorded"))
    for what, values in (("torque", log.tau), ("velocity", log.qd)):
        if values is None:
            continue
        flat = (np.ptp(values, axis=0) == 0.0) & (moved > MOVED)
        names = tuple(name for name, same in zip(log.joint_names, flat, strict=True) if same)
        if names:
            says = f"the recorded {what} never changes, while the joint moves"
            findings.append(Finding("constant", names, says, "a channel that was not recorded", refuses=False))
    return findings
