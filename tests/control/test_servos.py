import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.control.servos import SERVO_KINDS, Servo, servo_command
from catenary.errors import InputError

Q, QD, TAU = np.array([0.3, -0.2]), np.array([1.0, -2.0]), np.array([0.8, -0.5])


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_a_servo_as_it_is_known_exerts_the_torque(kind, rng):
    """The plant: a current's torque, a proportional law's, and a motor's with back-EMF."""
    k, w = rng.uniform(0.5, 3.0, (2, 2))
    servos = [Servo(kind, *each, step=1e-6, free_speed=free) for each, free in zip([(k[0],), (k[1],)], w, strict=True)]
    command = servo_command(servos, TAU, Q, QD).value
    exerted = {"current": k * command, "position": k * (command - Q), "pwm": k * (command - QD / w)}[kind]
    assert_allclose(exerted, TAU, atol=1e-5)


@pytest.mark.parametrize("kind", SERVO_KINDS)
def test_95_of_100_torques_lie_within_the_interval(kind, rng):
    servos = [Servo(kind, 2.0, error=0.05, step=-0.01, free_speed=6.0)]
    inside = []
    for _ in range(2000):
        asked = rng.normal(size=1)
        told = servo_command(servos, asked + 0.02 * rng.normal(size=1), Q[:1], QD[:1], deviation=0.02)
        k = 2.0 * (1.0 + 0.05 * rng.normal())
        off = {"current": 0.0, "position": Q[0], "pwm": QD[0] / 6.0}[kind]
        inside.append(abs(k * (told.counts[0] * -0.01 - off) - asked[0]) < told.half_width[0])
    assert 0.93 < np.mean(inside) < 0.97


def test_limits_are_of_the_offset_and_the_torque_says_what_is_left():
    servos = [Servo("position", 2.0, limit=0.1), Servo("current", 2.0, limit=0.1)]
    told = servo_command(servos, TAU, Q, QD)
    assert_allclose(told.value, [0.4, -0.1])
    assert_allclose(told.torque, [0.2, -0.2])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"kind": "force", "gain": 1.0}, 'servo kind "force": expected one of current, position, pwm'),
        ({"kind": "pwm", "gain": 0.0}, "gain: expected a number above zero"),
        ({"kind": "pwm", "gain": 1.0, "step": 0.0}, "one count's size, got zero"),
        ({"kind": "pwm", "gain": 1.0, "error": -0.1}, "error: expected zero or more"),
    ],
)
def test_wrong_servos_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        Servo(**arguments)
