import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.evaluate import Evaluation, evaluate
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.reports.calibration import kinematics_of, tip_blocks, tip_errors
from catenary.robots.catalog import load_robot
from recordings import data_of, fitted

UNITS = ("rad", "rad", "m")


def found(error: np.ndarray, names: tuple[str, ...], units: tuple[str, ...]) -> tuple[CalibrationModel, Evaluation]:
    """A model of the fixed offset fitted to a RAVEN-II or dVRK-like motion with a constant error."""
    rng = np.random.default_rng(0)
    q = np.array([0.5, 1.2, 0.4, 0.1, 0.1, 0.1])[: len(names)] + 0.05 * rng.standard_normal((60, len(names)))
    log = MotionLog(
        name="run", joint_names=names, joint_units=units, q_nominal=q, q_encoder=q + error,
        ok=np.ones(len(q), dtype=bool), time=np.arange(len(q)) / 30.0,
    )  # fmt: skip
    model = fitted(log, kind="offset")
    return model, evaluate(model, data_of(log, kind="offset"))


@pytest.mark.parametrize("shift", [-0.02, 1e-4])
def test_a_slide_that_is_off_moves_the_tip_by_as_much(shift: float) -> None:
    raven = load_robot("raven2")
    tip = tip_errors(raven, *found(np.array([0.0, 0.0, shift]), raven.joint_names, UNITS))
    # the slide moves the tip along a straight line
    assert_allclose(tip.distances(tip.reported), abs(shift), atol=1e-12)
    assert_allclose(tip.distances(tip.corrected), 0.0, atol=1e-9)  # the fixed offset takes a constant error away


def test_joints_are_matched_by_name_or_by_the_first_units_and_others_must_not_move_the_tip() -> None:
    names = ("J1", "J2", "J3", "J4", "J5", "J6")
    units = (*UNITS, "rad", "rad", "rad")
    model, evaluation = found(np.full(6, 1e-3), names, units)
    psm = kinematics_of("dvrk_psm_motors", model)
    assert psm is not None
    tip = tip_errors(psm, model, evaluation)
    assert tip.moves == (True, True, True, False, False, False)
    assert "J4, J5, J6" in str(tip_blocks(tip, "offset", names)[-1])
    assert kinematics_of("panda", model) is None
    assert kinematics_of("raven2_full", found(np.zeros(3), ("a", "b", "c"), UNITS)[0]) is None
    assert kinematics_of(None, model) is None
    with pytest.raises(InputError, match="its tip does not follow"):
        tip_errors(load_robot("panda"), model, evaluation)
