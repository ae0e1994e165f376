"""Recordings of a simulated arm, made in memory: hours of motion in a minute, without bags in between."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.plant import UNUSED_CHANNEL, MotionLog
from catenary.raven2.topics import ARM_OF_SIDE, JOINTS, RAVENSTATE, UNITS, further_columns
from catenary.simulation.cable_plant import CablePlant, as_reported, of_both_arms
from catenary.simulation.firmware import joint_torques
from catenary.simulation.firmware_plant import FirmwarePlant, Log
from catenary.simulation.simulated_plant import PERIOD
from catenary.trajectories.reference import Trajectory

_STATE_RATE_HZ = 30.0  # [Hz] at which the paper recorded raven_state
_ENCODER_TICKS = 10  # of 1 ms between samples of the external encoders
_STAMP_JITTER = 0.3  # of the period, either way
CHUNK_TICKS = 60_000  # ticks whose full log is held at once
_APPROACH_TICKS = 4_000  # to the start of a motion
CALIBRATED_JOINTS = 3  # positioning joints; the rest are the tool's


def record_simulated(
    plant: CablePlant,
    trajectory: Trajectory,
    name: str,
    rng: np.random.Generator,
    *,
    state_rate: float = _STATE_RATE_HZ,
    columns: Sequence[str] = (),
    other_arm: CablePlant | None = None,
) -> MotionLog:
    """Drive a homed arm along a trajectory of its positioning joints [rad, rad, m] and record what a lab would.

    The robot's state is sampled at `state_rate` [Hz], its stamps jittered by `rng`; the external encoders at 100 Hz,
    their positions interpolated to these stamps. The log has shoulder, elbow, insertion with q_nominal, q_encoder,
    tau [Nm, Nm, N]; the tool, which stands still, and the unused channel are signals q:<joint> and tau:<joint>.

    Args:
        columns: Further columns of raven_state that the log carries, ("all",) for every one.
        other_arm: The robot's other arm, homed, which holds its setpoint meanwhile; parked when None.

    Raises:
        NotReadyError: The arm is not homed or enabled, or its software e-stop tripped.

    Examples:
        >>> arm = catenary.CablePlant(seed=0)
        >>> arm.home()
        >>> path = catenary.random_sinusoids(np.random.default_rng(0), 5.0)
        >>> log = catenary.record_simulated(arm, path, "run", np.random.default_rng(0))
        >>> log.joint_names, len(log)
        (('shoulder', 'elbow', 'insertion'), 150)
    """
    _approach(plant, trajectory)
    stamps = _stamps(round(trajectory.duration / PERIOD), state_rate, rng)
    joint: list[Floats] = []
    torque: list[Floats] = []
    encoder: list[Floats] = []
    further: list[dict[str, Floats]] = []
    units: dict[str, str] = {}
    last = 0
    for log, _ in driven(plant, trajectory, CHUNK_TICKS):
        first, last = last, last + len(log.q)
        here = stamps[(stamps >= first) & (stamps < last)] - first
        held = None if other_arm is None else other_arm.run(np.full((last - first, len(JOINTS)), np.nan))[here]
        joint.append(as_reported(plant, log.joint[here]))
        torque.append(joint_torques(plant.firmware, as_reported(plant, log.torque[here])))
        if columns:
            ticks = of_both_arms(plant, log[here], other_arm, held)
            signals, units = _state_signals(plant, ticks, len(here), columns)
            further.append(signals)
        seen = np.arange(0, last - first, _ENCODER_TICKS)
        positions = plant.encoders.positions(plant.encoders.counts(log.q[seen]))
        encoder.append(np.column_stack([np.interp(here, seen, positions[:, j]) for j in range(CALIBRATED_JOINTS)]))
    q, tau = np.concatenate(joint), np.concatenate(torque)
    tools, nothing = JOINTS[CALIBRATED_JOINTS:], np.zeros(len(q))
    return MotionLog(
        name=name,
        joint_names=JOINTS[:CALIBRATED_JOINTS],
        joint_units=UNITS[:CALIBRATED_JOINTS],
        q_nominal=q[:, :CALIBRATED_JOINTS],
        q_encoder=np.concatenate(encoder),
        ok=np.ones(len(q), dtype=bool),
        time=stamps.astype(np.float64) * PERIOD,
        tau=tau[:, :CALIBRATED_JOINTS],
        signals={f"q:{tool}": q[:, CALIBRATED_JOINTS + t] for t, tool in enumerate(tools)}
        | {f"tau:{tool}": tau[:, CALIBRATED_JOINTS + t] for t, tool in enumerate(tools)}
        | {f"q:{UNUSED_CHANNEL}": nothing, f"tau:{UNUSED_CHANNEL}": nothing}
        | {name: np.concatenate([part[name] for part in further]) for name in units},
        signal_units={f"q:{tool}": "rad" for tool in tools} | {f"tau:{tool}": "Nm" for tool in tools} | units,
        robot=plant.arm.name,
        simulated=True,
    )


def _state_signals(
    plant: CablePlant, ticks: dict[str, Floats], rows: int, columns: Sequence[str]
) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return columns of raven_state from a simulation's ticks; zero where it has no such quantity."""
    state: dict[str, Floats] = {}
    for column in RAVENSTATE.columns:
        values = ticks.get(column.name, np.zeros((rows, column.width))).reshape(rows, column.width)
        state |= dict(zip(column.paths, values.T.astype(np.float64), strict=True))
    further = further_columns(columns, ARM_OF_SIDE[plant.side])
    signals = {name: state[path] for name, (path, _) in further.items()}
    return signals, {name: unit for name, (_, unit) in further.items()}


def driven(plant: FirmwarePlant[Log], trajectory: Trajectory, chunk: int) -> Iterator[tuple[Log, float]]:
    """Drive an arm along a trajectory of its first joints; yield each piece of its log, and the share done."""
    ticks = max(1, round(trajectory.duration / PERIOD))
    for first in range(0, ticks, chunk):
        last = min(ticks, first + chunk)
        moved = trajectory.sample(np.arange(first, last) * PERIOD)[0]
        rows: Floats = np.full((last - first, len(plant.joint_names)), np.nan)
        rows[:, : moved.shape[1]] = moved
        yield plant.run(rows), last / ticks


def _approach(plant: CablePlant, trajectory: Trajectory) -> None:
    """Go to the start of a motion along half a cosine, and wait there for a moment."""
    start = plant.control.setpoint[:CALIBRATED_JOINTS].copy()
    goal = trajectory(0.0).q
    share = 0.5 * (1.0 - np.cos(np.pi * np.minimum(np.arange(1, _APPROACH_TICKS + 500) / _APPROACH_TICKS, 1.0)))
    rows = np.full((len(share), len(JOINTS)), np.nan)
    rows[:, :CALIBRATED_JOINTS] = start + (goal - start) * share[:, None]
    plant.run(rows)


def _stamps(ticks: int, rate: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Ticks at which the state is sampled: at the rate, jittered, strictly rising."""
    count = int(ticks * PERIOD * rate)
    times = (np.arange(count) + 0.5 + rng.uniform(-_STAMP_JITTER, _STAMP_JITTER, count)) / rate
    return np.unique(np.clip((times / PERIOD).astype(np.int64), 0, ticks - 1))
