"""A PSM's recorded topics onto the stamps of its measured_js: a MotionLog to calibrate with, and a report."""

from pathlib import Path

import numpy as np

from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.extract import topic_file
from catenary.recording.series import interpolate
from catenary.recording.synchronise import Synchronisation, read_first_column, read_series
from catenary.recording.topics import PSM_JOINTS, SECOND, psm_topic

ROBOT = "dvrk_psm"  # of the catalogue, in the joints of measured_js
UNITS = ("rad", "rad", "m", "rad", "rad", "rad")
MAX_GAP = 0.05  # [s] between two samples that are interpolated between


def synchronise_psm(folder: Path, namespace: str) -> Synchronisation:
    """Bring a tracker's positions of a PSM's joints onto the stamps of its measured_js.

    A row is a message of measured_js: `q_nominal`, `qd` and `tau` are its positions, velocities and efforts,
    `q_encoder` is the tracker between its two neighbours in time. `ok` is cleared where these lie further apart than
    MAX_GAP, before the first and after the last.

    Args:
        folder: What `extract` wrote.
        namespace: Of the arm, such as /PSM1.
    """
    state_topic, tracker_topic = (
        psm_topic(namespace, verb) for verb in ("measured_js", "tracker/measured_js")
    )
    file = topic_file(folder, state_topic)
    names = [name for column in state_topic.columns for name in column.names]
    state = read_series(file, names, MAX_GAP)
    span = (int(state.stamp[0]), int(state.stamp[-1]))
    tracker = read_first_column(folder, tracker_topic, MAX_GAP, span, state.report.clock_steps)
    n = len(PSM_JOINTS)
    whole = np.isfinite(state.values[:, :n]).all(axis=1)
    stamp, values = state.stamp[whole], state.values[whole]
    if len(stamp) == 0:
        raise InputError(f'recording "{folder.name}": no message of measured_js with finite numbers is left')
    q_nominal = values[:, :n]
    q_encoder, ok = interpolate(tracker, stamp, MAX_GAP)
    ok &= np.isfinite(q_encoder).all(axis=1)
    reports = (state.report, tracker.report)
    notes = [note for report in reports for note in report.notes()]
    # a driver may leave velocities or efforts out
    qd, tau = (
        part if np.isfinite(part).all() else None for part in (values[:, n : 2 * n], values[:, 2 * n :])
    )
    log = MotionLog(
        name=folder.name,
        joint_names=PSM_JOINTS,
        joint_units=UNITS,
        q_nominal=q_nominal,
        q_encoder=q_encoder,
        ok=ok,
        time=(stamp - stamp[0]) / SECOND,
        began=int(stamp[0]) / SECOND,
        qd=qd,
        tau=tau,
        robot=file.about.robot if file.about.robot is not None else ROBOT,
        simulated=file.about.simulated,
        notes=tuple(notes),
    )
    return Synchronisation(log, reports, int((~ok).sum()), int((~whole).sum()))
