"""The fit of the simulated RAVEN-II to the papers' results."""

import shutil
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.simulation.simulated_plant import PERIOD
from papers.plant.circles import SHOWN, Circles, followed
from papers.plant.refit import fitted, write_arm
from papers.plant.targets import free_numbers, shares_of, with_shares

ROBOT = "raven2_friction.toml"
RUBBING = load_cable_arm(ROBOT)
FREE = free_numbers(RUBBING)


def test_fitted_numbers_are_written_and_everything_else_stays(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    with as_file(files("catenary.simulation") / "data" / ROBOT) as packaged:
        shutil.copy(packaged, path)
    shares = np.linspace(0.1, 0.9, len(FREE))
    write_arm(with_shares(load_cable_arm(path), FREE, shares), path)
    after = load_cable_arm(path)
    assert_allclose(shares_of(after, FREE), shares, atol=1e-3)  # six digits are written
    fitted_fields = {each.field for each in FREE}
    for name in set(RUBBING.cable.fields) - fitted_fields:
        assert_allclose(after.cable[name], RUBBING.cable[name], rtol=0)
    assert [entry.note for entry in after.file.cable.values()] == [entry.note for entry in RUBBING.file.cable.values()]


def test_no_fitted_number_stands_on_a_bound_and_capstans_alike_differ_as_pulleys_may() -> None:
    shares = shares_of(RUBBING, FREE)
    assert [one.name for one, share in zip(FREE, shares, strict=True) if not 0.01 < share < 0.99] == []
    assert abs(RUBBING.cable.ratio_error[0] - RUBBING.cable.ratio_error[1]) < 0.02


def test_a_fit_finds_numbers_whose_misses_are_known() -> None:
    free = FREE[:4]
    truth = np.array([0.2, 0.8, 0.5, 0.4])
    mixing = np.random.default_rng(0).standard_normal((9, 4)) + 3.0 * np.eye(9, 4)

    def misses(arm: CableArm) -> np.ndarray:
        away = shares_of(arm, free) - truth
        return 10.0 * mixing @ (away + 0.3 * away**2)  # nothing else counts beside it

    assert_allclose(shares_of(fitted(RUBBING, free, misses, 12), free), truth, atol=0.02)


def test_coulomb_friction_is_found_from_positions_and_setpoints() -> None:
    firmware, n = RUBBING.firmware, 3
    time = np.arange(0.0, 60.0, PERIOD)
    joint = np.tile(firmware.home_value, (len(time), 1))
    joint[:, :n] += [0.2, 0.2, 0.02] * np.sin(np.outer(time, [0.7, 0.9, 1.1]))
    speed = [0.2, 0.2, 0.02] * np.cos(np.outer(time, [0.7, 0.9, 1.1])) * [0.7, 0.9, 1.1]
    c, friction = firmware.coupling, np.array([0.9, 1.3, 15.0])

    def wound(q: np.ndarray) -> np.ndarray:
        return q @ np.array([[1.0, c[0], c[1]], [0.0, 1.0, c[2]], [0.0, 0.0, 1.0]])

    stiffness, damping = (
        gain[:n] * firmware.ratio[:n] ** 2 / firmware.gearbox[:n] for gain in (firmware.kp, firmware.kd)
    )
    torque = friction * np.sign(wound(speed)) + damping * wound(speed)
    setpoint = joint.copy()
    setpoint[:, :n] += (torque / stiffness) @ np.linalg.inv(wound(np.eye(3)))
    setpoint[:, n:] += np.random.default_rng(1).standard_normal((len(time), 4))
    found = followed(firmware, Circles(time, joint, setpoint))
    assert_allclose(found.friction, friction, rtol=0.02)  # speeds are smoothed where they turn
    assert_allclose(found.error[n:], SHOWN[n:], rtol=0.05)
    assert_allclose(found.likeness, 0.0, atol=0.05)
