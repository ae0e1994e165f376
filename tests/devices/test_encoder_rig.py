import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.devices.encoder_board import CountTracker, EncoderRig, Registration, Verdict
from catenary.errors import InputError
from catenary.simulation.cable_parameters import RAVEN2_STIFF, load_cable_arm
from catenary.simulation.cable_plant import CablePlant


def test_a_quarter_turn_and_a_centimetre_from_the_stops():
    zero = np.array([100.0, -200.0, 300.0])
    counts = zero + np.array([20_000.0, -20_000.0, -2000.0])
    # 80,000 counts a turn, 5 um a count; 0, 130 deg and 572.467 mm at the stops
    expected = np.array([np.deg2rad(90.0), np.deg2rad(40.0), 0.562467])
    assert_allclose(EncoderRig().positions(counts, zero), expected, rtol=1e-12)
    assert_allclose(EncoderRig().positions(np.tile(counts, (4, 1)), zero), np.tile(expected, (4, 1)))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bits": 20}, "expected one of"),
        ({"direction": np.array([0.0, 1.0, 1.0])}, "expected 1 or -1"),
        ({"direction": np.ones(2)}, "shape"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        EncoderRig(**options)


RIG = EncoderRig()
PERIOD = 0.01
STOPS = np.array([100.0, 30_000.0, 112_000.0])
AWAY = STOPS - RIG.side * np.array([6000.0, 8000.0, 30_000.0])


def leg(start, end, seconds):
    share = np.linspace(0.0, 1.0, round(seconds / PERIOD))[:, None]
    return np.round(start + (end - start) * share)


def homing(rest=1.0):
    """Straight into the stops, a rest, and home again; counts."""
    return np.vstack([leg(AWAY, STOPS, 5.0), leg(STOPS, STOPS, rest), leg(STOPS, AWAY, 2.0)])


def homed(rows, homed=True, registration=None):
    """Told that the robot homes while these rows come."""
    registration = registration or Registration(RIG)
    registration.set_robot_state(homing=True, homed=False)
    for row in rows:
        registration.update(row)
    registration.set_robot_state(homing=False, homed=homed)
    return registration


@pytest.mark.parametrize(
    ("rows", "is_homed", "reason"),
    [
        (homing()[:600], True, ""),
        (homing(), False, "without the robot being homed"),
        (np.tile(AWAY, (100, 1)), True, "without the joints having moved"),
    ],
    ids=["homed", "homing failed", "did not move"],
)
def test_the_robots_word_ends_the_registration(rows, is_homed, reason):
    registration = homed(rows, is_homed)
    assert reason in registration.reason
    if reason:
        assert registration.zero is None
    else:
        assert_allclose(registration.zero, STOPS, atol=3.0)


@pytest.mark.parametrize("told", [True, False])
def test_a_robot_that_does_not_home_or_says_nothing_registers_nothing(told):
    registration = Registration(RIG)
    if told:
        registration.set_robot_state(homing=False, homed=True)
    for row in homing():
        registration.update(row)
    assert not registration.is_watching
    assert registration.zero is None


def test_homing_again_registers_anew():
    registration = homed(homing())
    homed(homing() + 500.0, registration=registration)
    assert_allclose(registration.zero, STOPS + 500.0, atol=3.0)


def test_a_joint_that_goes_past_its_stop_shows_that_it_was_none():
    registration = homed(homing())
    registration.update(STOPS + np.array([0.0, 0.0, 1000.0]))
    assert registration.zero is None
    assert "insertion moved beyond the registered stop" in registration.reason


@pytest.fixture(scope="module")
def simulated_homing():
    """An arm homes, then moves 0.1 rad, 0.1 rad, 20 mm to and fro: every 4 ms time, counts, state, its rig's positions."""
    plant = CablePlant(load_cable_arm(RAVEN2_STIFF), start=np.array([0.3, 1.7, 0.45]))  # with the rig of its source
    plant.state_command("enable")
    plant.state_command("home")
    rows = []

    def look():
        counts = plant.encoders.counts(plant.state.q)
        rows.append((plant.time, counts, plant.operating_state(), plant.encoders.positions(counts)))

    look()
    while plant.operating_state().is_busy:
        for _ in range(4):
            plant.wait()
        look()
    home = plant.measured_js().q
    for phase in np.linspace(0.0, 2.0 * np.pi, 250):
        target = home + np.sin(phase) * np.array([0.1, 0.1, 0.02, 0.0, 0.0, 0.0, 0.0])
        for _ in range(4):
            plant.servo_jp(target)
            plant.wait()
        look()
    return rows


@pytest.mark.slow
def test_a_simulated_arm_is_registered_as_its_own_rig_is(simulated_homing):
    tracker, registration = CountTracker(RIG), Registration(RIG)
    for time, row, state, _ in simulated_homing:
        verdict, counts, _ = tracker.update(tuple(map(int, row)), time, period=0.004)
        assert verdict is Verdict.GOOD
        registration.set_robot_state(state.is_busy and not state.is_homed, state.is_homed)
        registration.update(counts)
    assert registration.zero is not None
    _, counts, _, expected = simulated_homing[-1]
    # the rig's own sees every ms from when the joints seek, this one every second
    assert np.abs((RIG.positions(counts, registration.zero) - expected) * RIG.counts).max() < 1.0
