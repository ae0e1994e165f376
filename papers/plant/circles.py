"""The group's recording of automatic circles (2018): friction and following errors of a real RAVEN-II, and a simulated.

RAVEN_ILC, `raven_state_circle.npz`: joints and their setpoints [deg, deg, m x 180/pi, deg...]; no torque, no encoder
but the motors'. PD torque follows from them and the published gains, which are taken to be that date's; the firmware
compensates gravity while it draws, and so does the simulated one here.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from catenary import CablePlant
from catenary.arrays import Floats
from catenary.simulation.cable_parameters import CableArm, Firmware
from catenary.simulation.compiled_records import POSITIONING
from catenary.simulation.simulated_plant import PERIOD
from papers.calibration.recordings import START

CHANNELS = [0, 1, 2, 4, 5, 6, 7]  # of the eight; one is unused
BURST = 401  # rows over which arrival times are smoothed: they come in bursts
SPACING = 0.01  # [s] of the rows that are looked at
GRAVITY = (0, 0, 980)  # [cm/s2]
MOVING = 0.25  # of a joint's RMS speed: slower rows tell nothing of Coulomb friction
UNITS = np.array([1.0, 1.0, np.deg2rad(1e3)] + [1.0] * 4)  # mm per deg of the published insertion
SHOWN = np.append(np.rad2deg([1.0, 1.0]), [1e3, *np.rad2deg(np.ones(4))])


class Followed(NamedTuple):
    """How an arm's joints follow circles."""

    friction: Floats  # (3,) Coulomb friction of the positioning joints [Nm, Nm, N]
    error: Floats  # (7,) RMS of the setpoint less the position [deg, deg, mm, deg...]
    likeness: Floats  # (6,) correlations of the four tool axes' errors


class Circles(NamedTuple):
    """A recording on a regular clock."""

    time: Floats  # (N,) [s]
    joint: Floats  # (N, 7) [rad, rad, m, rad...]
    setpoint: Floats


def read_circles(path: Path) -> Circles:
    """Read the recording, on a clock of one tick."""
    with np.load(path) as content:
        arrival = uniform_filter1d(content["t"], BURST, mode="nearest")
        signals = [np.deg2rad(content[name][:, CHANNELS].astype(float)) for name in ("jpos", "jpos_d")]
    arrival = np.maximum.accumulate(arrival) + 1e-9 * np.arange(len(arrival))
    time = np.arange(arrival[BURST // 2], arrival[-BURST // 2], PERIOD)
    joint, setpoint = (
        np.column_stack([np.interp(time, arrival, uniform_filter1d(each, 5)) for each in signal.T])
        for signal in signals
    )
    return Circles(time, joint, setpoint)


def followed(firmware: Firmware, circles: Circles) -> Followed:
    """Return what positions and setpoints tell of friction: PD torque against the side to which a joint moves."""
    rows = slice(None, None, round(SPACING / PERIOD))
    joint, setpoint = circles.joint[rows], circles.setpoint[rows]
    ratio, n = firmware.ratio[:POSITIONING], POSITIONING
    speed = uniform_filter1d(np.gradient(_windings(firmware, joint), SPACING, axis=0), 9, axis=0)
    error = _windings(firmware, setpoint - joint)
    torque = (firmware.kp[:n] * error - firmware.kd[:n] * speed) * ratio**2 / firmware.gearbox[:n]
    friction = np.empty(n)
    for j in range(n):
        moves = np.abs(speed[:, j]) > MOVING * np.sqrt(np.mean(speed[:, j] ** 2))
        columns = np.column_stack([np.sign(speed[:, j]), np.ones(len(joint)), joint[:, :n] - joint[:, :n].mean(axis=0)])
        slopes, *_ = np.linalg.lstsq(columns[moves], torque[moves, j])
        friction[j] = slopes[0]
    missed = setpoint - joint
    alike = np.asarray(np.corrcoef(missed[:, n:].T))
    likeness = alike[np.triu_indices(len(alike), 1)]
    return Followed(friction, np.sqrt(np.mean(missed**2, axis=0)) * SHOWN, likeness)


def _windings(firmware: Firmware, joint: Floats) -> Floats:
    c = firmware.coupling
    windings: Floats = joint[:, :3] + np.column_stack(
        [np.zeros(len(joint)), c[0] * joint[:, 0], c[1] * joint[:, 0] + c[2] * joint[:, 1]]
    )
    return windings


def drawn_by(arm: CableArm, circles: Circles, seed: int | None = None) -> Followed:
    """Let a simulated arm draw the same circles."""
    plant = CablePlant(arm, seed=seed, start=START, substeps=1, grav_dir=GRAVITY)
    plant.home()
    home, first = plant.control.setpoint.copy(), circles.setpoint[0]
    share = 0.5 * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, 4000)))[:, np.newaxis]
    plant.run(np.vstack([home + share * (first - home), np.tile(first, (500, 1))]))
    log = plant.run(circles.setpoint)
    return followed(plant.firmware, Circles(circles.time, log.joint, log.setpoint))
