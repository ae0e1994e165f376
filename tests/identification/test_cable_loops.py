"""Friction, stiffness and hysteresis of cables from reversals: against a play and a spring in closed form, and simulated arms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.identification.cable_loops import CableLoop, Interval, cable_loops
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.firmware import joint_torques
from catenary.transmission.cable_elasticity import bouc_wen_step
from catenary.transmission.cable_friction import coupled_friction, dragged
from command_line import catenary, refusal

STIFFNESS, JOINT_SIDE, MOTOR_SIDE = 90.0, 0.3, 0.5  # [Nm/rad, Nm, Nm]
EVERY = 5  # ticks of 1 ms


def holds(interval: Interval, least: float, widest: float | None = None) -> bool:
    return interval.low <= (least if widest is None else widest) and interval.high >= least


def spring_and_friction() -> MotionLog:
    """A motor with friction, a spring, a joint with friction and a load that grows with its position."""
    t = np.arange(0.0, 120.0, 0.005)
    q = 0.3 * np.sin(0.4 * t) + 0.08 * np.sin(0.8 * t + 1.0)
    friction = coupled_friction([[1.0 / STIFFNESS]], [[1.0]], [[JOINT_SIDE]], [1e-3])
    load = 1.5 * q
    x = q + friction.lag(q[:, np.newaxis])[:, 0, 0] - load / STIFFNESS
    tau = STIFFNESS * (q - x) + MOTOR_SIDE * np.sign(np.gradient(q))
    x, q, tau = (each[:, np.newaxis] for each in (x, q, tau))
    return MotionLog("spring", ("joint",), ("rad",), q, np.ones(len(t), bool), q_encoder=x, time=t, tau=tau)


def test_a_spring_between_two_frictions_is_found() -> None:
    (loop,), doubts = cable_loops(spring_and_friction())
    assert not doubts
    assert loop.stiffness.value == pytest.approx(STIFFNESS, rel=0.03)
    assert loop.friction.value == pytest.approx(JOINT_SIDE + MOTOR_SIDE, rel=0.03)
    assert loop.joint_side.value == pytest.approx(JOINT_SIDE, rel=0.1)
    assert loop.motor_side.value == pytest.approx(MOTOR_SIDE, rel=0.1)
    assert loop.width.value == pytest.approx(2.0 * JOINT_SIDE / STIFFNESS, rel=0.1)


@pytest.mark.parametrize(("file", "is_shown"), [("raven2_friction.toml", 2), ("raven2.toml", 0)])
def test_what_is_told_of_a_simulated_raven2_holds_its_truth(file: str, is_shown: int) -> None:
    plant = CablePlant(load_cable_arm(file), substeps=1)
    plant.home()
    t = np.arange(0.0, 120.0, 0.001)
    swings = [
        np.sin(w * t + a) + 0.35 * np.sin(2.7 * w * t + 2.0 * a) for w, a in ((0.31, 0.0), (0.42, 1.1), (0.5, 2.3))
    ]
    rows = np.full((len(t), 7), np.nan)
    rows[:, :3] = plant.setpoint_js().q[:3] + np.minimum(t / 4.0, 1.0)[:, np.newaxis] * np.column_stack(swings) * [
        0.25, 0.3, 0.05
    ]  # fmt: skip
    log = plant.run(rows)[::EVERY]
    tau = joint_torques(plant.firmware, log.torque)[:, :3]
    seen = plant.encoders.positions(plant.encoders.counts(log.q))[:, :3]
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    recorded = MotionLog(
        file, names, units, log.joint[:, :3], np.ones(len(log.q), bool), q_encoder=seen, time=t[::EVERY], tau=tau
    )
    loops, doubts = cable_loops(recorded)
    assert not doubts
    cable = plant.cable
    assert sum(np.isfinite(loop.stiffness.value) for loop in loops) >= is_shown
    for j, loop in enumerate(loops):
        load = float(np.percentile(np.abs(tau[:, j]), 95.0))  # friction grows with it
        motor = cable.rotor_friction[j] * cable.ratio[j] * (1.0 + cable.ratio_error[j])
        joint = cable.link_friction[j] + cable.node_friction[j]
        by_load = cable.rotor_load_friction[j], cable.link_load_friction[j] + cable.node_load_friction[j]
        assert holds(loop.friction, motor + joint, motor + joint + load * sum(by_load))
        for side, least, growth in ((loop.joint_side, joint, by_load[1]), (loop.motor_side, motor, by_load[0])):
            assert np.isnan(side.value) or holds(side, least, least + load * growth)
        assert np.isnan(loop.stiffness.value) or holds(loop.stiffness, cable.stiffness[j])
        assert np.isfinite(loop.stiffness.value) or any("stiffness" in why for why in loop.untold)


def test_the_command_prints_it_and_refuses_torques_of_the_wrong_sign(tmp_path: Path) -> None:
    log, good, bad = spring_and_friction(), tmp_path / "good.parquet", tmp_path / "bad.parquet"
    write_parquet(log, good)
    assert log.tau is not None
    write_parquet(replace(log, tau=-log.tau), bad)
    (joint,) = catenary("identify-cable", good, "--json").json["joints"]
    assert set(joint) == set(CableLoop._fields)
    assert joint["stiffness"][0] == pytest.approx(STIFFNESS, rel=0.03)
    assert "drives the joint" in refusal("identify-cable", bad)
    write_parquet(replace(log, tau=None), bad)
    assert "friction needs torques" in refusal("identify-cable", bad)


def windup(parameters: Floats, way: Floats) -> Floats:
    """Return a motor's torque along its way while the joint stands: cable, friction inside it and at the motor, load."""
    elastic, yielding, width, rise, inside, motor, load = parameters
    z = node = 0.0
    torque = []
    for stretch, step in zip(way, np.diff(way, prepend=0.0), strict=True):
        z, node = bouc_wen_step(z, step, width), dragged(node, step, rise, inside)
        torque.append(elastic * stretch + yielding * width * z + node + motor * np.sign(step) + load)
    return np.array(torque)


@pytest.mark.parametrize("joint", range(3))
def test_fisher_information_of_small_reversals_tells_a_width_from_inner_friction_only_where_the_joint_is_clamped(
    joint: int,
) -> None:
    # a minute of wind-ups; errors of 3 % of the friction that last 0.12 s, as a fit to such a recording of the plant left
    cable = load_cable_arm("raven2_friction.toml").cable
    stiffness, share, width = cable.stiffness[joint], cable.elastic_share[joint], cable.hysteresis_width[joint]
    place, inside, motor = cable.node_share[joint], cable.node_friction[joint], cable.rotor_friction * cable.ratio
    truth = np.array([
        (share + cable.slow_share[joint]) * stiffness, (1.0 - share) * stiffness, width,
        (1.0 - place) / place * stiffness, (1.0 - place) * inside, motor[joint], 0.1 * motor[joint],
    ])  # fmt: skip
    noise = 0.03 * (motor[joint] + inside + cable.link_friction[joint])
    way = np.linspace(0.0, 6.0 * width, 3000)
    at_motor, within = windup(truth * [1, 1, 1, 1, 0, 0, 0], way), windup(truth * [0, 0, 1, 1, 1, 0, 0], way)
    slips = way[np.argmax(at_motor - place / (1.0 - place) * within > cable.link_friction[joint])]
    bounds = []
    for widest in (slips, 3.0 * width):
        turns = np.array([0.0, *(side * part * widest for part in (1.0, 0.75, 0.5, 0.25, 1.0) for side in (1, -1))])
        loops = np.interp(np.arange(0.0, 10.0, 0.005), np.arange(11.0), turns)
        steps = 1e-4 * truth
        jacobian = np.column_stack([
            (windup(truth + step, loops) - windup(truth - step, loops)) / 2e-4 for step in np.diag(steps)
        ])[200:]  # fmt: skip
        information = jacobian.T @ jacobian * (60.0 / 0.12 / len(jacobian)) / noise**2
        bounds.append(float(np.sqrt(np.linalg.inv(information)[2, 2])))  # as a share of the width
    assert bounds[0] > 0.25
    assert bounds[1] < 0.5 * bounds[0]
