from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from catenary.errors import NotReadyError
from catenary.plant import OperatingState
from catenary.simulation import cable_plant
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.simulation.cable_plant import _SEEK_SPEEDS, CablePlant, mean_near_peak
from oracles.cable_arms import homed_plant, linear_arm

Floats = NDArray[np.float64]
DEG_MM = np.array([180.0 / np.pi, 180.0 / np.pi, 1e3])
STOPS = np.array([0.0, 137.5, 562.0])  # what the robot registers there [deg, deg, mm]
RIG_STOPS = load_cable_arm().rig.registered * DEG_MM
HOME = np.array([30.0, 90.0, 400.0])


class Homing(NamedTuple):
    """What a homing came to; positioning joints [deg, deg, mm]."""

    start: Floats
    seconds: float
    robot_at_stops: Floats  # as the robot reads them, registered a tick ago
    rig_at_stops: Floats
    registration: Floats  # encoder offsets as joint positions
    robot_at_home: Floats
    rig_at_home: Floats
    tools_at_home: Floats  # [rad]


def homing_plant(**options: Any) -> CablePlant:
    """A plant that has just begun to home."""
    plant = CablePlant(**options)
    plant.state_command("enable")
    plant.state_command("home")
    return plant


def wait(plant: CablePlant, ticks: int) -> None:
    for _ in range(ticks):
        plant.wait()


def home_and_watch(start: Floats, arm: CableArm | None = None, substeps: int = 1) -> Homing:
    plant = homing_plant(arm=arm, start=start, substeps=substeps)
    at_stops = None
    while plant.operating_state().is_busy:
        plant.wait()
        if at_stops is None and np.isfinite(plant.encoders.zero).all():
            sample = plant.telemetry()
            at_stops = sample["jpos"][:3] * DEG_MM, sample["ext_jpos"] * DEG_MM
    seconds = plant.time
    wait(plant, 500)
    sample = plant.telemetry()
    registration = sample["encoffsets"][:3] / (4000.0 / (2.0 * np.pi)) / plant.firmware.ratio[:3]
    assert at_stops is not None
    return Homing(
        start,
        seconds,
        *at_stops,
        registration * DEG_MM,
        sample["jpos"][:3] * DEG_MM,
        sample["ext_jpos"] * DEG_MM,
        sample["jpos"][3:],
    )


@pytest.fixture(scope="module")
def homings() -> list[Homing]:
    """The same arm, homed from twenty places."""
    rng = np.random.default_rng(11)
    low, high = [np.deg2rad(5.0), np.deg2rad(50.0), 0.25], [np.deg2rad(85.0), np.deg2rad(130.0), 0.50]
    return [home_and_watch(rng.uniform(low, high)) for _ in range(20)]


@pytest.mark.slow
def test_every_homing_registers_the_stops_and_ends_at_home(homings):
    for h in homings:
        # the amplifiers 1 s, tools to their stops some 4.5 s, two registrations of 0.2 s, two moves of 2.5 s
        to_stops = np.abs(load_cable_arm().cable.stop_position - h.start) / np.abs(_SEEK_SPEEDS[:3])
        assert_allclose(h.seconds, 11.0 + to_stops.max(), atol=2.0)
        assert_allclose(h.robot_at_stops, STOPS, atol=0.02)  # a tick's motion after registration
        # the insertion has sprung back from the peak by what its stop gives way, 60 N on 1e5 N/m; the elbow has
        # left its stop: its motor went on following the shoulder, by up to 85 deg times the error of the coupling
        off = np.abs(h.rig_at_stops - RIG_STOPS)
        assert (off < [0.05, 85.0 * (0.14545 - 0.0874), 0.8]).all(), h.rig_at_stops
        assert_allclose(h.robot_at_home, HOME, atol=0.5)  # gravity and friction against the PD: 0.16 deg a Nm
        # without damping the tool's integral hunts about its friction: 5 mNm of 0.013 Nm/rad, over the ratio
        assert_allclose(h.tools_at_home, [0.0, 0.0, np.pi / 4, np.pi / 4], atol=0.15)


def test_robot_and_rig_differ_by_their_registrations_where_cables_are_known_and_stiff():
    arm = linear_arm()
    known = arm.cable.replace(ratio_error=np.zeros(3), coupling=arm.firmware.coupling.copy())
    arm = arm._replace(cable=known.replace(stiffness=10.0 * known.stiffness))
    h = home_and_watch(np.array([0.5, 1.5, 0.4]), arm, substeps=4)
    # wound up at the stops by 4 Nm on 2560 Nm/rad; the insertion's stop gives way by 60 N on 1e5 N/m
    assert (
        np.abs(h.robot_at_home - h.rig_at_home - (STOPS - DEG_MM * arm.rig.registered)) < [0.15, 0.15, 0.7]
    ).all(), h


@pytest.mark.slow
def test_rig_sees_what_the_registrations_and_the_cables_make_of_home(homings):
    difference = np.mean([h.robot_at_home - h.rig_at_home for h in homings], axis=0)
    off = np.abs(difference - (STOPS - RIG_STOPS))
    assert (off[1:] < [3.0, 3.0]).all()  # stretched cables and wrong ratios: degrees, not tens of them


@pytest.mark.slow
def test_homing_again_spreads_the_elbow_and_spares_the_others(homings):
    # while the elbow stands at its stop its motor goes on following the shoulder, by a coupling that is not the true one
    spread = np.std([h.registration for h in homings], axis=0)
    assert spread[1] > 5.0 * spread[0], spread  # deg
    assert spread[1] > 1.5 * spread[2]  # mm


def test_homing_goes_tools_first_while_the_positioning_joints_stand():
    plant = homing_plant()
    start, tool = plant.state.q.copy(), plant.state.rotor[3:].copy()
    wait(plant, 2500)  # a second of waiting, then the tools run
    assert (np.abs(plant.state.rotor[3:] - tool) > 1.0).all()
    assert_allclose(plant.state.q, start, atol=0.02)  # brakes off: the arm has settled on its motors


def test_tool_meets_its_stops_before_the_insertion_moves():
    plant, meets = homing_plant(), np.full(7, np.nan)
    while plant.operating_state().is_busy:
        plant.wait()
        into_stop = plant.control.seek == 2
        meets[np.isnan(meets) & into_stop] = plant.time
    assert np.nanmax(meets[3:6]) < np.nanmin(meets[:3])


def test_homed_arm_stays_homed_and_registered_through_a_stop():
    plant = homed_plant()
    before = plant.telemetry()["encoffsets"]
    plant.state_command("disable")
    plant.state_command("enable")
    assert plant.operating_state() == OperatingState("ENABLED", is_homed=True, is_busy=False)
    assert_array_equal(plant.telemetry()["encoffsets"], before)
    plant.servo_jr(np.zeros(7))


@pytest.mark.parametrize("verb", ["servo_jp", "servo_jr", "servo_jf"])
def test_arm_that_homes_refuses_to_be_moved(verb):
    with pytest.raises(NotReadyError, match="homing"):
        getattr(homing_plant(), verb)(np.zeros(7))


@pytest.mark.parametrize("command", ["disable", "pause"])
def test_interrupted_homing_is_given_up(command):
    plant = homing_plant()
    wait(plant, 2000)
    plant.state_command(command)
    here = plant.state.rotor.copy()
    wait(plant, 500)
    assert plant.operating_state()[1:] == (False, False)  # neither homed nor busy
    assert_array_equal(plant.state.rotor, here)


def test_arm_homes_after_an_interrupted_homing():
    plant = homing_plant(substeps=1)
    wait(plant, 7000)
    plant.state_command("disable")
    plant.home()
    assert plant.operating_state().is_homed
    assert_allclose(plant.measured_js().q[:3] * DEG_MM, HOME, atol=1.0)


def test_an_axis_that_meets_no_stop_ends_the_homing(monkeypatch):
    monkeypatch.setattr(cable_plant, "_MAX_SEEK_S", 12.0)
    arm = load_cable_arm()
    arm.cable.stop_position[0] = -1e3
    plant = CablePlant(arm, substeps=1)
    with pytest.raises(NotReadyError, match=r"shoulder.* reached no stop in 12 s"):
        plant.home()
    plant.wait()
    assert plant.operating_state() == OperatingState("FAULT", is_homed=False, is_busy=False)


def test_rig_takes_the_mean_of_the_counts_near_its_peak():
    rig = load_cable_arm().rig
    counts = np.array([[-100.0, 50.0, 10.0], [-130.0, 99.0, 30.0], [-150.0, 100.0, 31.0], [0.0, 0.0, 0.0]])
    zero = mean_near_peak(counts, np.array([-1.0, 1.0, 1.0]), rig.window)
    # windows of 50, 20, 20 counts
    assert_allclose(zero, [-(100 + 130 + 150) / 3, 99.5, 30.5])
