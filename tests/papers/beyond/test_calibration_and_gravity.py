from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, MotionLog, Reference, gravity_torque, load_robot
from catenary.calibration.fit_options import FitOptions
from catenary.plant import AT_REST
from catenary.workflows.gravity.simulated_arm import rigid_arm
from papers.beyond import calibration_and_gravity as experiment
from papers.beyond.bases import AXES, BASES
from papers.beyond.calibrated_gravity import (
    CONTROLLERS,
    HOLDS,
    INSIDE,
    REPORTED,
    STILL,
    CalibratedGravity,
    control,
    held,
)
from papers.calibration.recordings import fitted
from papers.experiment import NOMINAL, Case, Outcomes, Scope


def result(case: Case) -> Any:
    if case.load() is control:
        made = {}
        for name in CONTROLLERS:
            true = 0.4 if name == STILL else 3.0
            values = {
                "reported": 0.1,
                "true": true,
                "pd_share": 20.0,
                "gravity": 0.02 if name == INSIDE else 0.1,
            }
            made[name] = {what: [value] * 3 for what, value in values.items()} | {"outside": [0.0] * 3}
        return made
    if case.load() is held:
        return {name: [[0.01, 0.02, 0.03]] * len(case.arguments["angles_deg"]) for name in HOLDS}
    error = 0.3 if "q" in case.arguments["inputs"] and "tau" in case.arguments["inputs"] else 0.6
    return {base: {"linear": [error] * 3, "network": [error] * 3, "outside": 0.0} for base in BASES}


def made_up() -> Outcomes:
    return Outcomes({case: result(case) for case in experiment.cases(Scope(robots=(NOMINAL, 1)))})


def test_report_compares_reported_with_calibrated_joints() -> None:
    report = experiment.report(made_up())
    tracking, holding, calibration = (one.table for one in report.tables)
    assert len(tracking.rows) == len(CONTROLLERS) * len(experiment.CONTROL_BASES)
    assert [row[0] for row in holding.rows] == ["0", "20", "45", "90", "180"]
    assert len(calibration.rows) == 2 * 2 * 2
    first, second = report.remarks
    assert "wrong by 0.020/0.020/0.020 Nm/Nm/N in place of 0.100/0.100/0.100" in first
    assert "from 3.000/3.000/3.000 to 0.400/0.400/0.400" in first
    assert "0.300/0.300/0.300" in second
    assert "0.600/0.600/0.600" in second


def test_drift_is_kept_by_angle() -> None:
    for values in experiment.drift(made_up(), REPORTED).values():
        assert_allclose(values, [[0.01, 0.02, 0.03]] * 2)


def test_gravity_is_computed_at_the_calibrated_joints() -> None:
    pytest.importorskip("mujoco")
    rng, shift = np.random.default_rng(0), np.array([0.1, -0.2, 0.01])
    q = rng.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (30, 3))
    tau = rng.uniform(-1.0, 1.0, (30, 3))
    log = MotionLog("off by a shift", AXES, ("rad", "rad", "m"), q, np.ones(30, bool), q + shift, tau=tau)
    arm = rigid_arm(load_robot("raven2"))
    controller = CalibratedGravity(arm, fitted([log], FitOptions("linear")), gains=True)
    gravity, at = np.array([1.0, -2.0, -9.0]), q.mean(axis=0)
    state = JointState(0.0, at, np.zeros(3), np.zeros(3), np.zeros(0), gravity, 0.0, AT_REST)
    error = np.array([0.01, 0.02, 0.001])
    found = controller.torque(state, Reference(at + error, np.zeros(3), np.zeros(3)))
    expected = gravity_torque(arm.model, at + shift, gravity)
    assert_allclose(controller.feedforward, expected, atol=1e-9)
    assert_allclose(found - expected, arm.gains.kp * error, atol=1e-9)  # PD stays on reported joints


def test_raw_torque_is_shared_with_the_tilted_bases() -> None:
    from papers.beyond import tilted_calibration

    scope = Scope(robots=(NOMINAL,))
    shared = set(experiment.cases(scope)) & set(tilted_calibration.cases(scope))
    assert len(shared) == 2  # trained level and on several tilts
