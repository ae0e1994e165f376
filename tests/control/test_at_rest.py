"""On a base at rest controllers run kernels, elsewhere recursions: the two must be one law."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.control.controller import SplitController
from catenary.control.elastic import Compensation, ElasticPD
from catenary.control.gravity_pd import At, GravityHold, GravityPD
from catenary.control.inertia_pd import InertiaPD
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference

ARM = load_robot("raven2")
KP, KD, SPRINGS = [454.0, 362.0, 57e3], [12.0, 9.6, 4564.0], [264.0, 507.0, 71e3]
CONTROLLERS = {
    "hold": lambda: GravityHold(ARM),
    **{f"pd, {at}": lambda at=at: GravityPD(ARM, KP, KD, at=at) for at in ("measured", "desired")},
    "inertia": lambda: InertiaPD(ARM, 900.0, 42.0, motor_inertia=np.diag([0.1, 0.2, 0.3])),
    "computed torque": lambda: InertiaPD(ARM, 900.0, 42.0, coriolis=True),
    **{
        f"elastic, {way}": lambda way=way: ElasticPD(ARM, KP, KD, SPRINGS, compensation=way)
        for way in ("constant", "online", "biased")
    },
}
assert set(At.__args__) == {"measured", "desired"}
assert set(Compensation.__args__) == {"constant", "online", "biased"}


def state_and_reference(rng: np.random.Generator) -> tuple[JointState, Reference]:
    q, qd, q_ref, qd_ref, qdd_ref = rng.normal(size=(5, 3))
    gravity = 5.0 * rng.normal(size=3)
    state = JointState(0.0, q.copy(), qd.copy(), np.zeros(3), np.zeros(0), gravity, 0.0, np.zeros((2, 3)))
    return state, Reference(q_ref.copy(), qd_ref.copy(), qdd_ref.copy())


def parts(controller: SplitController, state: JointState, reference: Reference) -> np.ndarray:
    tau = controller.torque(state, reference)
    return np.array([tau, controller.feedback, controller.feedforward])


@pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)
def test_kernels_and_recursions_are_one_law(make) -> None:
    controller, rng = make(), np.random.default_rng(1)
    for _ in range(5):
        state, reference = state_and_reference(rng)
        at_rest = parts(controller, state, reference)
        # 1e-200 rad/s turn nothing, but there is no kernel for them
        turning = parts(controller, state._replace(base_rates=np.full((2, 3), 1e-200)), reference)
        assert_allclose(at_rest, turning, rtol=1e-12, atol=1e-9)  # of torques of some 1e5


@pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)
def test_arrays_of_any_layout_give_the_same(make) -> None:
    controller = make()
    state, reference = state_and_reference(np.random.default_rng(2))
    strided = state._replace(q=np.repeat(state.q, 2)[::2], gravity=np.repeat(state.gravity, 3)[::3])
    assert_allclose(
        parts(controller, strided, reference), parts(controller, state, reference), rtol=1e-12, atol=1e-9
    )


@pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)
def test_a_base_whose_turning_is_not_known_gives_no_torque(make) -> None:
    state, reference = state_and_reference(np.random.default_rng(3))
    rates = np.zeros((2, 3))
    rates[0, 1] = np.nan
    assert np.isnan(make().torque(state._replace(base_rates=rates), reference)).any()
