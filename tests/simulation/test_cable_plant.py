import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, NotReadyError
from catenary.gravity.torque import gravity_torque
from catenary.plant import OperatingState, fault_of
from catenary.raven2.topics import CHANNELS, raven_topics
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, FixedBase, RockingBase
from catenary.simulation.cable_parameters import RAVEN2_ECCENTRIC, load_cable_arm, varied_arm
from catenary.simulation.cable_plant import (
    _AXIS_FIELDS,
    _PAYLOAD_PLACE,
    _REPORTED_FIELDS,
    COLUMNS,
    CablePlant,
    ExternalEncoders,
    PositioningArm,
    of_both_arms,
    telemetry_of,
)
from catenary.simulation.firmware import TickLog
from catenary.transmission.cable_elasticity import tensions_for, winding_of
from oracles.cable_arms import ROBOTS, homed_plant, linear_arm, smooth_motion

GRAVITY = np.array([0.0, 0.0, -9.81])
MODEL = load_robot("raven2")
ROCKING = RockingBase(0.1, 0.1, 0.3, lever=(0.0, 0.2, 0.5))
SENT = ("tau", "dac_val", "jpos_d", "mpos_d")
READ = ("encVals", "mpos", "mvel", "jpos", "jvel")


def settle(plant, seconds=0.5, torque=None):
    """Wait, commanding a torque where one is given; returns the plant."""
    for _ in range(round(seconds / plant.period)):
        if torque is not None:
            plant.servo_jf(np.array(torque))
        plant.wait()
    return plant


@pytest.mark.alike
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("base", [None, ROCKING], ids=["still", "rocking"])
def test_ticking_equals_running_bit_for_bit(robot, base):
    ticked = homed_plant(robot=robot, base=base)
    run = copy.deepcopy(ticked)
    rows = smooth_motion(run.setpoint_js().q, 1.5 if base else 0.4)  # beyond a block of the base's timeline
    log = run.run(rows)
    for k, row in enumerate(rows):
        read = ticked.telemetry()
        for name in READ:
            assert_array_equal(read[name], getattr(log, _REPORTED_FIELDS[name][0])[k])
        assert_array_equal(read["q_true"], log.q[k])
        ticked.servo_jp(row)
        ticked.wait()
        sent = ticked.telemetry()
        for name in SENT:
            assert_array_equal(sent[name], getattr(log, _REPORTED_FIELDS[name][0])[k])
    assert ticked.state == run.state


def test_a_long_run_equals_its_pieces_bit_for_bit():
    whole = homed_plant(base=ROCKING)
    pieces = copy.deepcopy(whole)
    rows = smooth_motion(whole.setpoint_js().q, 3.0)
    log = whole.run(rows)
    parts = [pieces.run(part) for part in np.split(rows, [7, 1500, 2048])]
    for name in log.fields:
        assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(log, name))


def test_a_copy_ticks_for_itself():
    plant = homed_plant()
    twin, before = copy.deepcopy(plant), (plant.state.copy(), plant.control.copy())
    twin.servo_jr(np.full(7, 1e-4))
    settle(twin, 0.02)
    assert (plant.state, plant.control) == before
    assert twin.state != before[0]


def test_parameters_that_are_replaced_are_those_of_the_next_tick():
    changed, fresh = homed_plant(), homed_plant()
    changed.cable = varied_arm(changed.arm, np.random.default_rng(2)).cable
    assert settle(changed, 0.02).state != settle(fresh, 0.02).state


def test_a_base_whose_rows_lie_strangely_in_memory_is_stood_upon():
    class Strange(FixedBase):
        def sample(self, times):
            gravity, motion = super().sample(times)
            rows = np.asfortranarray(np.tile(gravity, (len(times), 1)))
            return BaseSamples(rows, np.tile(motion, (len(times), 1, 1)))

    strange, plain = (settle(CablePlant(base=base), 0.005) for base in (Strange(0.1), FixedBase(0.1)))
    assert strange.state == plain.state


@pytest.mark.parametrize("seed", [None, 4])
def test_a_seed_stands_for_one_robot_and_one_motion(seed):
    a, b = (settle(CablePlant(seed=seed), 0.2) for _ in range(2))
    assert a.state == b.state
    assert a.cable == b.cable
    assert (a.cable.stiffness != CablePlant(seed=2).cable.stiffness).all()


def test_fewer_substeps_move_the_arm_nearly_as_more_do():
    one, two, four = (homed_plant() for _ in range(3))
    one.substeps, two.substeps, four.substeps = 1, 2, 4
    rows = smooth_motion(one.setpoint_js().q, 10.0)
    a, b, c = (plant.run(rows) for plant in (one, two, four))
    # where a joint lets go differs by an instant
    assert (np.abs(b.q - c.q).max(axis=0) < [np.deg2rad(0.05), np.deg2rad(0.05), 1.5e-4]).all()
    # what calibration sees: where the joint is against where the robot believes it is; a model leaves .1 deg and more
    difference = np.sqrt(np.mean(((a.q - a.joint[:, :3]) - (b.q - b.joint[:, :3])) ** 2, axis=0))
    assert (difference < [np.deg2rad(0.015), np.deg2rad(0.01), 2e-5]).all()


def test_payload_pulls_with_the_gravity_torque_of_a_mass_at_the_wrist():
    bare, loaded = (settle(CablePlant(payload=mass), 2.0) for mass in (0.0, 0.5))  # on their brakes
    link, tree = MODEL.tree, loaded._tree
    assert_allclose(tree.mass[2], link.mass[2] + 0.5)
    assert_allclose(tree.mass[2] * tree.com[2], link.mass[2] * link.com[2] + 0.5 * _PAYLOAD_PLACE)
    assert loaded.state.q[2] < bare.state.q[2]  # hangs deeper


def test_arm_sags_on_its_brakes_as_stiffness_and_gravity_say():
    start = np.array([np.deg2rad(60.0), np.deg2rad(80.0), 0.35])
    plant = settle(CablePlant(linear_arm(), start=start), 4.0)
    # cables pull what gravity asks, through the coupling
    cable = plant.cable
    tension = tensions_for(cable.coupling, gravity_torque(MODEL, plant.state.q, GRAVITY))
    unwound = winding_of(cable.coupling, start - plant.state.q)
    assert_allclose(unwound, tension / cable.stiffness, rtol=1e-3)  # still swinging a little


@pytest.fixture(scope="module")
def both_arms():
    """Both arms, equally damped (the green insertion is damped less), homed on a level base.

    The tools may take a tick more on one arm, and rocking would go on meanwhile.
    """
    left, right = CablePlant(), CablePlant(side="right")
    right.firmware = right.firmware.replace(kd=left.firmware.kd)
    left.home(), right.home()
    return left, right


@pytest.mark.parametrize("command", ["disable", None])
def test_mirrored_bases_move_both_arms_alike(both_arms, command):
    base = RockingBase(0.15, 0.2, 0.5, axis=(1.0, 0.3, 0.2), lever=(0.1, 0.2, 0.4))
    mirrored = RockingBase(-0.15, -0.2, 0.5, axis=(1.0, -0.3, 0.2), lever=(0.1, -0.2, 0.4))
    left, right = copy.deepcopy(both_arms)
    begun = right.state.q - left.state.q  # roundings decide when a stop is reached
    for plant, moving in ((left, base), (right, mirrored)):
        plant._base, plant._tick = BaseTimeline(moving, plant.period), 30_000
        if command is not None:
            plant.state_command(command)
        settle(plant, 1.0)
    assert_allclose(begun, 0.0, atol=2e-4)
    assert_allclose(left.state.q + begun, right.state.q, atol=1e-5)  # and single encoder steps


def test_gravity_torques_hold_the_arm():
    plant = homed_plant()
    start = plant.state.q.copy()
    for _ in range(1000):
        plant.servo_jf(gravity_torque(MODEL, plant.measured_js().q[:3], GRAVITY))
        plant.wait()
    # between gravity and friction nothing moves but what the motors' springs give back
    assert (np.abs(plant.state.q - start) < [np.deg2rad(1.0), np.deg2rad(1.0), 2e-3]).all()


def test_without_torque_a_heavy_arm_falls():
    plant = homed_plant(payload=2.0)
    start = plant.state.q.copy()
    assert start[2] - settle(plant, 1.0, torque=np.zeros(3)).state.q[2] > 0.01


def test_measured_torque_is_the_one_that_was_commanded_and_the_column_is_at_the_gearbox():
    torque = [1.0, -0.5, 10.0, 0.01, 0.0, 0.0, 0.0]
    plant = settle(homed_plant(), 0.001, torque)
    assert_allclose(plant.measured_js().tau, torque, atol=1e-12)
    assert {c.name: c.unit for c in CablePlant.columns}["tau"].startswith("Nm at the gearbox")
    assert_allclose(plant.telemetry()["tau"][2], 10.0 * 12.25 / 2158.59, rtol=1e-12)


def test_position_control_takes_over_from_torques_without_a_jump():
    plant = settle(homed_plant(), 0.3, torque=[4.0, 0.0, 0.0])  # let it be pushed aside
    assert np.abs(plant.setpoint_js().q - plant.measured_js().q)[0] < 0.01
    pushed = plant.measured_js().q[0]
    plant.servo_jr(np.zeros(7))
    plant.wait()
    assert abs(plant.setpoint_js().q[0] - pushed) < 0.01


def test_brakes_hold_the_motors_exactly():
    plant = homed_plant()
    plant.state_command("pause")
    before = plant.state.rotor.copy()
    assert_array_equal(settle(plant).state.rotor, before)


@pytest.mark.parametrize("steps", [["disable"], ["pause"], ["disable", "enable"], ["pause", "resume"]])
def test_states_change_without_a_jolt(steps):
    plant = homed_plant()
    before = plant.state.q.copy()
    for command in steps:
        plant.state_command(command)
        settle(plant, 0.2)
    assert (np.abs(plant.state.q - before) < [np.deg2rad(0.5), np.deg2rad(0.5), 1e-3]).all()


TRANSITIONS = [
    ("DISABLED", "enable", "ENABLED"),
    ("DISABLED", "resume", "DISABLED"),
    ("DISABLED", "pause", "DISABLED"),
    ("ENABLED", "pause", "PAUSED"),
    ("ENABLED", "resume", "ENABLED"),
    ("ENABLED", "disable", "DISABLED"),
    ("PAUSED", "resume", "ENABLED"),
    ("PAUSED", "enable", "PAUSED"),
    ("PAUSED", "disable", "DISABLED"),
    ("FAULT", "enable", "ENABLED"),
    ("FAULT", "resume", "FAULT"),
    ("FAULT", "disable", "DISABLED"),
]
REACHED_BY = {"DISABLED": "disable", "ENABLED": "resume", "PAUSED": "pause"}


def faulty_plant():
    """A plant whose software e-stop has tripped."""
    plant = homed_plant()
    gains = plant.firmware
    plant.firmware = gains.replace(kp=100.0 * gains.kp)
    plant.servo_jp(plant.lower)
    settle(plant, 0.001)
    plant.firmware = gains
    return plant


@pytest.mark.parametrize(("before", "command", "after"), TRANSITIONS)
def test_operating_state_follows_crtk(before, command, after):
    plant = faulty_plant() if before == "FAULT" else homed_plant()
    plant.state_command(REACHED_BY.get(before, "resume"))
    assert plant.operating_state().state == before
    plant.state_command(command)
    assert plant.operating_state() == OperatingState(after, is_homed=True, is_busy=False)


@pytest.mark.parametrize(("command", "is_busy"), [("home", True), ("unhome", False)])
def test_arm_that_homes_or_is_unhomed_is_not_homed(command, is_busy):
    plant = homed_plant()
    plant.state_command(command)
    assert plant.operating_state() == OperatingState("ENABLED", is_homed=False, is_busy=is_busy)


def test_too_large_a_torque_trips_the_software_stop_also_in_a_run():
    with pytest.raises(NotReadyError, match="FAULT and homed: the software e-stop tripped"):
        faulty_plant().servo_jp(np.zeros(7))
    plant = homed_plant()
    plant.firmware = plant.firmware.replace(kp=100.0 * plant.firmware.kp)
    with pytest.raises(NotReadyError, match="software e-stop"):
        plant.run(np.tile(plant.upper, (1000, 1)))


@pytest.mark.parametrize("rows", [np.zeros((5, 3)), np.zeros(7), np.full((2, 7), np.inf)])
def test_run_refuses_rows_that_are_no_setpoints(rows):
    with pytest.raises(InputError, match="run"):
        homed_plant().run(rows)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"side": "middle"}, "left or right"),
        ({"payload": -1.0}, "payload"),
        ({"payload": np.nan}, "payload"),
        ({"substeps": 0}, "substeps"),
        ({"start": [0.1, 0.2]}, "start"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        CablePlant(**options)


def test_a_command_is_the_plants_own_copy():
    plant = homed_plant()
    start = plant.setpoint_js().q
    wanted = start.copy()
    plant.servo_jp(wanted)
    wanted += 0.001
    plant.wait()
    assert_allclose(plant.setpoint_js().q, start, atol=1e-15)


def test_rig_columns_agree_with_the_true_joints():
    plant = homed_plant()
    sample = plant.telemetry()
    assert_array_equal(sample["joint_enc"], np.round(sample["q_true"] * plant.encoders.rig.counts))
    # the rig calls the stops 0, 130 deg and 0.572467 m
    offset = plant.encoders.rig.registered - plant.cable.stop_position
    assert_allclose(sample["ext_jpos"] - sample["q_true"], offset, atol=1e-3)


def test_encoders_off_their_centres_turn_as_a_pin_does_about_another_axis():
    rig = load_cable_arm(RAVEN2_ECCENTRIC).rig
    encoders = ExternalEncoders(rig)
    encoders.zero[:] = 0.0
    q = np.linspace(0.3, 2.0, 200)
    seen = encoders.positions(encoders.counts(np.column_stack([q, q, 0.2 * q]))) - rig.registered
    for j in (0, 1):  # a pin at radius 1 from the joint's axis, the encoder's axis e beside that
        e = rig.eccentricity[j]
        axis = e * np.array([np.sin(rig.eccentric_phase[j]), -np.cos(rig.eccentric_phase[j])])
        turned = np.unwrap(np.arctan2(np.sin(q) - axis[1], np.cos(q) - axis[0]))
        assert_allclose(seen[:, j], turned, atol=0.5 * e**2 + e**3)  # its square is left out
        assert np.ptp(seen[:, j] - q) > 0.02
    assert_allclose(seen[:, 2], 0.2 * q, atol=1e-5)
    assert not load_cable_arm().rig.eccentricity.any()


@pytest.mark.parametrize(("joint", "tau"), [(0, 7.0), (1, -1e300), (2, -1e300), (6, -7.0)])
def test_no_torque_takes_a_joint_beyond_its_soft_limits(joint, tau):
    plant = homed_plant()
    torque = np.zeros(7)
    torque[joint] = tau
    beyond = np.full(7, -np.inf)
    for _ in range(60):
        settle(plant, 0.02, torque)
        q = plant.measured_js().q
        beyond = np.maximum(beyond, np.maximum(q - plant.upper, plant.lower - q))
    # what gravity and the cables' own swing take, and the insertion carries the tools' cables along
    assert (beyond <= [0.02, 0.02, 0.001, 0.08, 0.08, 0.08, 0.08]).all()
    assert abs(beyond[joint]) < 0.12  # it has come to its limit
    assert plant.operating_state().state == "ENABLED"


TICKS = 500


@pytest.fixture(scope="module", params=["left", "right"])
def run(request: pytest.FixtureRequest) -> tuple[CablePlant, TickLog, dict[str, Floats]]:
    plant = homed_plant(request.param)
    log = plant.run(smooth_motion(plant.setpoint_js().q, 1e-3 * TICKS))
    return plant, log, telemetry_of(plant, log)


def test_columns_are_those_that_are_declared_and_fit_the_topics(run) -> None:
    plant, _, telemetry = run
    assert set(telemetry) == set(COLUMNS)
    for topic in raven_topics("gold" if plant.side == "left" else "green"):
        for column in topic.columns:
            if column.name in telemetry:
                assert telemetry[column.name].shape == (TICKS, column.width), column.name


def test_an_arms_channels_are_its_own_and_the_parked_arms_are_zero(run) -> None:
    plant, log, telemetry = run
    arm, parked = ("gold", slice(8, 16)) if plant.side == "left" else ("green", slice(0, 8))
    for name, field in _AXIS_FIELDS.items():
        assert_array_equal(telemetry[name][:, list(CHANNELS[arm])], np.float32(getattr(log, field)))
        assert (telemetry[name][:, parked] == 0.0).all()


def test_the_last_row_of_true_joints_is_within_a_count_of_the_external_encoders(run) -> None:
    plant, log, telemetry = run
    assert (np.abs(telemetry["joint_enc"] - log.q * plant.encoders.rig.counts) <= 0.5).all()


def test_the_pose_is_that_of_the_reported_joints(run) -> None:
    plant, log, telemetry = run
    arm = 0 if plant.side == "left" else 1
    q = log.joint[-1]
    wrist = 0.5 * (q[6] - q[5])
    pose = forward_kinematics(plant.model, np.array([*q[:5], wrist]), plant.model.tip)
    base = plant.model.frames["frame0"].pose
    here = base.rotation.T @ (pose.position - base.position)
    assert_allclose(telemetry["pos"][-1, 3 * arm : 3 * arm + 3], here, atol=1e-12)  # metres, rounding
    rotation = telemetry["ori"][-1, 9 * arm : 9 * arm + 9].reshape(3, 3)
    assert_allclose(rotation, base.rotation.T @ pose.rotation, atol=1e-12)


def test_an_arm_that_runs_beside_another_fills_its_own_channels_and_pose() -> None:
    arms = [homed_plant(side) for side in ("left", "right")]
    logs = [plant.run(smooth_motion(plant.setpoint_js().q, 0.1)) for plant in arms]
    both = of_both_arms(arms[0], logs[0], arms[1], logs[1])
    alone = [telemetry_of(plant, log) for plant, log in zip(arms, logs, strict=True)]
    for name in _AXIS_FIELDS:
        assert_array_equal(both[name], np.where(np.arange(16) < 8, alone[0][name], alone[1][name]))
    assert_array_equal(both["pos"], np.hstack([alone[0]["pos"][:, :3], alone[1]["pos"][:, 3:]]))
    assert_array_equal(both["ext_jpos"], alone[0]["ext_jpos"])  # the rig is at the arm that moves


def test_positions_and_torques_have_the_digits_that_the_robot_reports() -> None:
    plant = homed_plant(robot=ROBOTS[1])
    told = telemetry_of(plant, plant.run(smooth_motion(plant.setpoint_js().q, 0.1)))
    for name in ("jpos", "tau"):
        assert_array_equal(told[name], np.float32(told[name]))


def test_joints_and_limits_are_those_of_the_model_of_the_name() -> None:
    arm, model = PositioningArm(homed_plant("left")), load_robot("raven2")
    assert arm.joint_names == model.joint_names
    assert arm.joint_units == model.joint_units
    assert_allclose(arm.lower, model.lower, atol=1e-9)
    assert_allclose(arm.upper, model.upper, atol=1e-9)


def test_the_tool_is_held_while_torques_move_the_arm() -> None:
    whole = homed_plant("left")
    arm = PositioningArm(whole)
    before = whole.measured_js().q
    for _ in range(300):
        arm.servo_jf(np.array([3.0, 0.0, 2.0]))
        arm.wait()
    after = whole.measured_js().q
    assert abs(after[0] - before[0]) > 0.01
    # the tool hunts by some degrees about its setpoint, as on the robot
    assert_allclose(after[3:], before[3:], atol=np.deg2rad(6.0))


def test_positions_move_the_same_joints_as_the_whole_arms_do() -> None:
    whole, other = homed_plant("left"), homed_plant("left")
    arm = PositioningArm(whole)
    for _ in range(50):
        wanted = arm.setpoint_js().q + np.array([1e-3, -1e-3, 1e-5])
        arm.servo_jp(wanted)
        other.servo_jp(np.concatenate([wanted, other.setpoint_js().q[3:]]))
        arm.wait()
        other.wait()
    assert_array_equal(whole.measured_js().q, other.measured_js().q)
    assert_array_equal(arm.q_true, whole.state.q)


def test_arm_says_why_it_is_in_fault_as_the_whole_one_does() -> None:
    whole = homed_plant("left")
    arm = PositioningArm(whole)
    whole.firmware = whole.firmware.replace(kp=100.0 * whole.firmware.kp)
    arm.servo_jp(arm.lower)
    arm.wait()
    assert arm.operating_state().state == "FAULT"
    assert "a motor's command was too large" in fault_of(arm)
