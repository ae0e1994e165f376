"""Recordings on bases that tilt and turn, against inverse dynamics on such bases."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify
from catenary.identification.options import IdentifyOptions
from catenary.robots.catalog import load_robot
from catenary.sensing.vector import tilted_gravity
from moving_arm import recorded, sinusoids

ARM = load_robot("panda")
PLAIN = IdentifyOptions(friction=(), prior=False)


def on_base(seed, gravity, rate=None, acceleration=None, **signals):
    """Recording of a Panda on a base whose gravity, angular rate and acceleration are given row by row."""
    rng = np.random.default_rng(seed)
    time = np.arange(len(gravity)) / 200.0
    q, qd, qdd = sinusoids(rng, ARM, time)
    base = None if rate is None else BaseMotion(rate, acceleration)
    tau = inverse_dynamics(ARM, q, qd, qdd, gravity, base) + 0.3 * qd
    columns = {f"gravity:{axis}": gravity[:, k] for k, axis in enumerate("xyz")}
    if rate is not None:
        columns |= {f"base_rate:{axis}": rate[:, k] for k, axis in enumerate("xyz")}
    log = recorded(ARM, 0, seconds=len(gravity) / 200.0, q_nominal=q, qd=qd, tau=tau)
    return replace(log, name=f"base{seed}", signals=columns | signals)


def rocking(rows):
    """Gravity, rate and acceleration of a base that rocks about its x axis by 0.4 rad at 0.2 Hz."""
    t, w = np.arange(rows) / 200.0, 2.0 * np.pi * 0.2
    roll = 0.4 * np.sin(w * t)
    gravity = 9.81 * np.column_stack([np.zeros(rows), -np.sin(roll), -np.cos(roll)])
    rate, acceleration = np.zeros((rows, 3)), np.zeros((rows, 3))
    rate[:, 0], acceleration[:, 0] = 0.4 * w * np.cos(w * t), -0.4 * w**2 * np.sin(w * t)
    return gravity, rate, acceleration


def test_the_regressor_of_a_turning_base_is_its_inverse_dynamics(rng):
    q, qd, qdd = rng.normal(size=(3, 8, 7))
    gravity, base = rng.normal(size=(8, 3)), BaseMotion(*rng.normal(size=(3, 8, 3)))
    Y = torque_regressor(ARM, q, qd, qdd, gravity, base)
    assert_allclose(
        Y @ link_parameters(ARM.tree), inverse_dynamics(ARM, q, qd, qdd, gravity, base), rtol=1e-9, atol=1e-9
    )


def test_a_rocking_base_is_not_taken_for_friction_or_masses():
    found = identify([on_base(0, *rocking(2500))], ARM, PLAIN, tests=[on_base(1, *rocking(2500))])
    still = identify([replace(on_base(0, *rocking(2500)), signals={})], ARM, PLAIN)
    assert (found.tests[0].relative_rms < 0.03).all()
    assert still.training[0].relative_rms[0] > 5.0 * found.training[0].relative_rms[0]


def test_tilts_show_what_a_level_base_hides():
    level = np.tile([0.0, 0.0, -9.81], (2000, 1))
    tilts = [np.tile(tilted_gravity(*angles), (2000, 1)) for angles in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))]
    one = identify([on_base(0, level)], ARM, PLAIN)
    three = identify([on_base(k, g) for k, g in enumerate(tilts)], ARM, PLAIN)
    assert three.base.count == one.base.count + 2  # first moments about joint 1's axis, which stands upright
    q, tilt = np.full((1, 7), 0.3), tilted_gravity(0.3, 0.2)
    true = gravity_torque(ARM, q, tilt)
    assert_allclose(gravity_torque(three.robot(), q, tilt), true, atol=0.05)


@pytest.mark.parametrize(
    ("signals", "said"),
    [
        ({"gravity:x": 0.0, "gravity:y": 0.0}, "gravity:z is missing"),
        ({"gravity:x": 0.0, "gravity:y": 0.0, "gravity:z": -1.0 / 9.81}, "is it in g?"),
        ({"gravity:x": 0.0, "gravity:y": np.nan, "gravity:z": -9.81}, "gravity is not finite at row 0"),
        ({f"base_rate:{axis}": 0.0 for axis in "xyz"}, "rates of the base and no gravity:x"),
    ],
)
def test_signals_that_cannot_be_are_refused(signals, said):
    log = recorded(ARM, 0)
    columns = {name: np.full(len(log), value) for name, value in signals.items()}
    with pytest.raises(InputError, match=said.replace("?", r"\?")):
        identify([replace(log, signals=columns)], ARM, PLAIN)
