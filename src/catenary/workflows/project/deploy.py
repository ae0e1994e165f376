"""Run a calibration model in the 1 kHz loop of a robot, and measure its latency and error there."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.evaluate import rms
from catenary.calibration.model import CalibrationModel
from catenary.config import IN_FILES
from catenary.control.loop import Tick, run_loop
from catenary.crtk.client import CrtkClient
from catenary.simulation.firmware_plant import FirmwarePlant
from catenary.trajectories.reference import Embedded, Trajectory
from catenary.units import DISPLAY
from catenary.workflows.robot.motion import check_motion, move_to

Known = float | None  # None where the encoders said nothing
Microseconds = dict[str, float]  # of a loop's durations


@dataclass(frozen=True)
class DeployedJoint:
    """Errors of a joint of the model against its true position, in deg or mm."""

    name: str
    unit: str
    raw_rmse: Known
    rmse: Known
    outside_valid_range: Known  # share of ticks
    coverage: Known  # share of errors within the model's intervals; None without any


@dataclass(frozen=True)
class Deployment:
    """What a deployed model did in a loop, as deployment.json holds it."""

    __pydantic_config__ = IN_FILES

    simulated: bool
    ticks: Annotated[int, Field(ge=0)]
    rate_hz: float
    compute_us: Microseconds | None
    jitter_us: Microseconds | None
    correction_us: Microseconds | None  # of the model's part of each tick
    overruns: Annotated[int, Field(ge=0)] | None  # None where nobody kept time
    real_time_priority: bool
    leaps: dict[str, int]  # by input: positions that play states did not follow
    coverage_asked: float | None  # by the model's intervals
    joints: tuple[DeployedJoint, ...]
    loop: Annotated[Any, Field(exclude=True)] = None  # its LoopReport, where it has just run


def deploy_on_robot(
    plant: FirmwarePlant[Any] | CrtkClient, model: CalibrationModel, trajectory: Trajectory, *, real_time: bool = False
) -> Deployment:
    """Run a model in the 1 kHz loop of a robot, homed and enabled, that follows a trajectory by its own firmware.

    A trajectory beyond the limits, and a robot that lacks what the model takes, are refused before anything moves.
    """
    places = [plant.joint_names.index(name) for name in model.joint_names if name in plant.joint_names]
    corrector = Corrector(model)
    # refuses before anything moves
    corrector.prepare(plant.joint_names, plant.joint_units, 1.0 / plant.period)
    joints = [plant.joint_names[j] for j in places]
    check_motion(plant, trajectory, joints=joints)
    move_to(plant, trajectory(0.0).q, joints=joints)
    motion = Embedded(trajectory, places, plant.setpoint_js().q)
    true: list[Floats] = []
    ticks: list[Tick] = []

    def observe(tick: Tick) -> None:  # light: it is part of the loop
        true.append(plant.external_encoders())
        ticks.append(tick)

    report = run_loop(plant, None, motion, corrector=corrector, observers=[observe], real_time=real_time)
    scale = np.array([DISPLAY[unit][1] for unit in model.joint_units])
    known = np.array(true)
    half_widths = np.array([tick.state.q_interval[places] for tick in ticks]) * scale
    rows = np.isfinite(known).all(axis=1)
    before = (known - np.array([tick.q_nominal[places] for tick in ticks]))[rows] * scale
    after = (known - np.array([tick.state.q[places] for tick in ticks]))[rows] * scale
    held = np.abs(after) <= half_widths[rows]
    deployed = tuple(
        DeployedJoint(
            name,
            DISPLAY[unit][0],
            rms(before[:, k]) if rows.any() else None,
            rms(after[:, k]) if rows.any() else None,
            (report.outside_valid_range or ())[places[k]],
            None if model.intervals is None or not rows.any() else float(np.mean(held[:, k])),
        )
        for k, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True))
    )
    return Deployment(
        simulated=plant.simulated,
        ticks=report.ticks,
        rate_hz=report.rate_hz,
        compute_us=report.compute and report.compute.in_us(),
        jitter_us=report.jitter and report.jitter.in_us(),
        correction_us=report.correction and report.correction.in_us(),
        overruns=report.overruns,
        real_time_priority=report.has_priority,
        leaps=corrector.leaps,
        coverage_asked=None if model.intervals is None else model.intervals.level,
        joints=deployed,
        loop=report,
    )
