import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError, NotReadyError, UnsupportedCommandError
from catenary.gravity.torque import gravity_torque
from catenary.plant import OperatingState
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, FixedBase, RockingBase
from catenary.simulation.cable_parameters import varied
from catenary.simulation.cable_plant import PAYLOAD_PLACE, CablePlant
from catenary.simulation.columns import COLUMNS
from oracles.cable_arms import homed_plant, smooth_motion

GRAVITY = np.array([0.0, 0.0, -9.81])
ROCKING = RockingBase(0.1, 0.1, 0.3, lever=(0.0, 0.2, 0.5))
SENT = {"tau": "torque", "dac_val": "dac", "jpos_d": "setpoint", "mpos_d": "motor_setpoint"}
READ = {
    "encVals": "counts",
    "mpos": "motor",
    "mvel": "motor_velocity",
    "jpos": "joint",
    "jvel": "joint_velocity",
}


def settle(plant, seconds=0.5):
    for _ in range(round(seconds / plant.period)):
        plant.wait()


@pytest.mark.parametrize("base", [None, ROCKING], ids=["still", "rocking"])
def test_ticking_equals_running_bit_for_bit(base):
    ticked = homed_plant(base=base)
    run = copy.deepcopy(ticked)
    rows = smooth_motion(run.setpoint_js().q, 1.5)  # beyond a block of the base's timeline
    log = run.run(rows)
    for k, row in enumerate(rows):
        read = ticked.telemetry()
        for name, column in READ.items():
            assert_array_equal(read[name], getattr(log, column)[k])
        assert_array_equal(read["q_true"], log.q[k])
        ticked.servo_jp(row)
        ticked.wait()
        sent = ticked.telemetry()
        for name, column in SENT.items():
            assert_array_equal(sent[name], getattr(log, column)[k])
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
    changed.cable = varied(changed.arm, np.random.default_rng(2)).cable
    settle(changed, 0.02), settle(fresh, 0.02)
    assert changed.state != fresh.state


def test_a_base_whose_rows_lie_strangely_in_memory_is_stood_upon():
    class Strange(FixedBase):
        def sample(self, times):
            gravity, motion = super().sample(times)
            rows = np.asfortranarray(np.tile(gravity, (len(times), 1)))
            return BaseSamples(rows, np.tile(motion, (len(times), 1, 1)))

    strange, plain = (CablePlant(seed=3, base=base) for base in (Strange(0.1), FixedBase(0.1)))
    settle(strange, 0.005), settle(plain, 0.005)
    assert strange.state == plain.state


def test_same_seed_gives_the_same_robot_and_the_same_motion():
    a, b = CablePlant(seed=4), CablePlant(seed=4)
    settle(a, 0.2), settle(b, 0.2)
    assert a.state == b.state
    assert a.cable == b.cable


def test_no_seed_gives_the_nominal_robot_at_the_same_place():
    assert_array_equal(CablePlant().state.q, CablePlant().state.q)
    assert_array_equal(CablePlant().cable.stiffness, CablePlant(start=[0.5, 1.5, 0.4]).cable.stiffness)


def test_different_seeds_give_different_robots():
    assert (CablePlant(seed=1).cable.stiffness != CablePlant(seed=2).cable.stiffness).all()


def test_two_substeps_move_the_arm_as_four_do():
    coarse = homed_plant(substeps=2)
    fine = copy.deepcopy(coarse)
    fine.substeps = 4
    rows = smooth_motion(coarse.setpoint_js().q, 10.0)
    difference = np.abs(coarse.run(rows).q - fine.run(rows).q).max(axis=0)
    # where a joint lets go differs by an instant
    assert (difference < [np.deg2rad(0.05), np.deg2rad(0.05), 1.5e-4]).all()


def test_one_substep_moves_the_arm_nearly_as_two_do():
    coarse = homed_plant(substeps=2)
    fine = copy.deepcopy(coarse)
    coarse.substeps = 1
    rows = smooth_motion(coarse.setpoint_js().q, 10.0)
    a, b = coarse.run(rows), fine.run(rows)
    # what calibration sees: where the joint is against where the robot believes it is
    difference = np.sqrt(np.mean(((a.q - a.joint[:, :3]) - (b.q - b.joint[:, :3])) ** 2, axis=0))
    assert (difference < [np.deg2rad(0.005), np.deg2rad(0.005), 2e-5]).all()


def test_payload_pulls_with_the_gravity_torque_of_a_mass_at_the_wrist():
    bare, loaded = CablePlant(), CablePlant(payload=0.5)
    model = load_robot("raven2")
    for plant in (bare, loaded):
        settle(plant, 2.0)  # on its brakes
    tree = loaded._tree
    assert_allclose(tree.mass[2], model.tree.mass[2] + 0.5)
    first_moment = model.tree.mass[2] * model.tree.com[2] + 0.5 * np.array(PAYLOAD_PLACE)
    assert_allclose(tree.mass[2] * tree.com[2], first_moment)
    assert loaded.state.q[2] < bare.state.q[2]  # hangs deeper


def test_arm_sags_on_its_brakes_as_stiffness_and_gravity_say():
    from oracles.cable_arms import linear_arm

    plant = CablePlant(linear_arm(), start=[np.deg2rad(60.0), np.deg2rad(80.0), 0.35])
    start = plant.state.q.copy()
    settle(plant, 4.0)
    # cables pull what gravity asks, through the coupling
    c01, c02, c12 = plant.cable.coupling
    hold = gravity_torque(load_robot("raven2"), plant.state.q, GRAVITY)
    third = hold[2]
    second = hold[1] - c12 * third
    first = hold[0] - c01 * second - c02 * third
    stretch = np.array([first, second, third]) / plant.cable.stiffness
    moved = start - plant.state.q
    winding = [moved[0], moved[1] + c01 * moved[0], moved[2] + c02 * moved[0] + c12 * moved[1]]
    assert_allclose(winding, stretch, rtol=1e-3)  # still swinging a little


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
    for plant, moving in ((left, base), (right, mirrored)):
        plant._base, plant._tick = BaseTimeline(moving, plant.period), 30_000
        if command is not None:
            plant.state_command(command)
        settle(plant, 1.0)
    assert_allclose(left.state.q, right.state.q, atol=1e-5)  # roundings may decide single encoder steps


def test_arms_differ_under_the_same_sideways_tilt():
    left, right = (CablePlant(base=FixedBase(roll=0.5), side=side) for side in ("left", "right"))
    for plant in (left, right):
        settle(plant)
    assert np.abs(left.state.q - right.state.q)[1] > 1e-4


def test_gravity_torques_hold_the_arm():
    plant = homed_plant()
    model = load_robot("raven2")
    start = plant.state.q.copy()
    for _ in range(1000):
        plant.servo_jf(gravity_torque(model, plant.measured_js().q[:3], GRAVITY))
        plant.wait()
    # between gravity and friction nothing moves but what the motors' springs give back
    assert (np.abs(plant.state.q - start) < [np.deg2rad(1.0), np.deg2rad(1.0), 2e-3]).all()


def test_without_torque_a_heavy_arm_falls():
    plant = homed_plant(payload=2.0)
    start = plant.state.q.copy()
    for _ in range(1000):
        plant.servo_jf(np.zeros(3))
        plant.wait()
    assert start[2] - plant.state.q[2] > 0.01


def test_measured_torque_is_the_one_that_was_commanded():
    plant = homed_plant()
    plant.servo_jf(np.array([1.0, -0.5, 2.0, 0.01, 0.0, 0.0, 0.0]))
    plant.wait()
    assert_allclose(plant.measured_js().tau, [1.0, -0.5, 2.0, 0.01, 0.0, 0.0, 0.0], atol=1e-12)


def test_position_control_takes_over_from_torques_without_a_jump():
    plant = homed_plant()
    for _ in range(300):  # let it be pushed aside
        plant.servo_jf(np.array([4.0, 0.0, 0.0]))
        plant.wait()
    assert np.abs(plant.setpoint_js().q - plant.measured_js().q)[0] < 0.01
    pushed = plant.measured_js().q[0]
    plant.servo_jr(np.zeros(7))
    plant.wait()
    assert abs(plant.setpoint_js().q[0] - pushed) < 0.01


def test_brakes_hold_the_motors_exactly():
    plant = homed_plant()
    plant.state_command("pause")
    before = plant.state.rotor.copy()
    settle(plant)
    assert_array_equal(plant.state.rotor, before)


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
REACHED = {"DISABLED": ["disable"], "ENABLED": [], "PAUSED": ["pause"]}


def in_state(name):
    plant = homed_plant()
    if name == "FAULT":
        plant.servo_jf(np.array([1e4, 0.0, 0.0]))
        plant.wait()
    for command in REACHED.get(name, []):
        plant.state_command(command)
    return plant


@pytest.mark.parametrize(("before", "command", "after"), TRANSITIONS)
def test_operating_state_follows_crtk(before, command, after):
    plant = in_state(before)
    assert plant.operating_state().state == before
    plant.state_command(command)
    assert plant.operating_state() == OperatingState(after, is_homed=True, is_busy=False)


def test_arm_is_busy_while_it_homes():
    plant = homed_plant()
    plant.state_command("home")
    assert plant.operating_state() == OperatingState("ENABLED", is_homed=False, is_busy=True)


def test_unhome_touches_only_is_homed():
    plant = homed_plant()
    plant.state_command("unhome")
    assert plant.operating_state() == OperatingState("ENABLED", is_homed=False, is_busy=False)


def test_too_large_a_torque_trips_the_software_stop():
    plant = homed_plant()
    plant.servo_jf(np.array([1e4, 0.0, 0.0]))
    plant.wait()
    assert plant.operating_state().state == "FAULT"
    with pytest.raises(NotReadyError, match="FAULT and homed: the software e-stop tripped"):
        plant.servo_jp(np.zeros(7))


def test_a_run_that_trips_the_software_stop_says_so():
    plant = homed_plant()
    plant.firmware = plant.firmware.replace(kp=100.0 * plant.firmware.kp)
    rows = np.tile(plant.upper, (1000, 1))
    with pytest.raises(NotReadyError, match="software e-stop"):
        plant.run(rows)


def test_unknown_state_command_is_refused_with_the_choices():
    with pytest.raises(UnsupportedCommandError, match="unhome"):
        CablePlant().state_command("dance")


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
    assert_array_equal(sample["joint_enc"], np.round(sample["q_true"] * plant.rig.counts))
    # the rig calls the stops 0, 130 deg and 0.572467 m
    offset = plant.rig.registered - plant.cable.stop_position
    assert_allclose(sample["ext_jpos"] - sample["q_true"], offset, atol=1e-3)


def test_torque_column_is_in_gearbox_units():
    plant = homed_plant()
    plant.servo_jf(np.array([0.0, 0.0, 10.0]))
    plant.wait()
    assert {c.name: c.unit for c in COLUMNS}["tau"].startswith("Nm at the gearbox")
    assert_allclose(plant.telemetry()["tau"][2], 10.0 * 12.25 / 2158.59, rtol=1e-12)


def test_inertial_sensors_read_the_bases_motion():
    base = RockingBase(0.1, 0.2, 0.5, lever=(0.1, 0.2, 0.4))
    plant = CablePlant(base=base)
    settle(plant, 0.3)
    gravity, motion = base.sample(np.array([plant.time]))
    seen = plant.telemetry()
    assert_allclose(seen["accelerometer"], motion[0, 2] - gravity[0], atol=1e-12)
    assert_allclose(seen["gyroscope"], motion[0, 0], atol=1e-12)
    assert_allclose(CablePlant().telemetry()["accelerometer"], [0.0, 0.0, 9.81])  # +g upwards at rest


def test_a_base_at_rest_has_no_rates():
    assert (CablePlant(base=FixedBase(0.3, 0.2)).measured_js().base_rates == 0.0).all()
