from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.dynamics.inverse_dynamics import forward_dynamics, inverse_dynamics
from catenary.errors import InputError, MissingInertiaError
from catenary.robots.actuation import Actuation, Friction, MotorInertia, Spring, actuation_terms
from catenary.robots.catalog import load_robot
from catenary.robots.mjcf import load_mjcf
from oracles.random_robots import random_mjcf

DOWN = np.array([0.3, -0.2, -9.7])


@pytest.mark.parametrize("seed", range(4))
def test_accelerations_with_rotors_dampers_and_springs_are_mujocos(seed, tmp_path):
    rng = np.random.default_rng(seed)
    text = random_mjcf(rng).replace('type="', 'armature="0.4" damping="0.7" stiffness="2" springref="0.1" type="')
    (tmp_path / "r.xml").write_text(text)
    ours, model = load_mjcf(tmp_path / "r.xml"), mujoco.MjModel.from_xml_string(text)
    model.opt.gravity = DOWN
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    q, qd, tau = rng.normal(size=(3, ours.n))
    at = [model.joint(name).dofadr[0] for name in ours.joint_names]
    data.qpos[at], data.qvel[at], data.qfrc_applied[at] = q, qd, tau
    mujoco.mj_forward(model, data)
    found = forward_dynamics(ours, q, qd, tau, DOWN, loads=known_loads(ours))
    assert_allclose(found, data.qacc[at], atol=1e-8 * np.abs(data.qacc).max())


def test_with_friction_it_is_the_inverse_of_inverse_dynamics(rng):
    model = load_robot("ur10e")
    rows = np.eye(6)
    actuation = Actuation(
        friction=tuple(Friction(f"f{k}", row, load=True, stribeck=0.1) for k, row in enumerate(rows)),
        motor_inertia=tuple(MotorInertia(f"m{k}", row) for k, row in enumerate(rows)),
        springs=(Spring("s", rows[1]),),
    )
    terms = actuation_terms(actuation)
    loads = ActuationLoads(6, actuation, terms, rng.uniform(0.05, 0.2, len(terms)))
    q, qd, qdd = rng.normal(size=(3, 20, 6))
    links = inverse_dynamics(model, q, qd, qdd, DOWN)
    tau = inverse_dynamics(model, q, qd, qdd, DOWN, loads=loads)
    assert_allclose(tau, links + loads.torque(q, qd, qdd, links))
    assert_allclose(forward_dynamics(model, q, qd, links, DOWN), qdd, atol=1e-7)
    assert_allclose(forward_dynamics(model, q, qd, tau, DOWN, loads=loads), qdd, atol=1e-7)
    heavy = loads._replace(
        values=np.array([3.0 if t.kind == "load" else v for t, v in zip(terms, loads.values, strict=True)])
    )
    with pytest.raises(InputError, match="friction takes more than the load"):
        forward_dynamics(model, q, qd, tau, DOWN, loads=heavy)


def test_what_has_no_accelerations_is_refused():
    with pytest.raises(MissingInertiaError):
        forward_dynamics(load_robot("tiago"), *np.zeros((3, load_robot("tiago").n)), DOWN)
    arm = load_robot("two_link")
    light = replace(arm, tree=arm.tree._replace(mass=arm.tree.mass * [1, 0], inertia=arm.tree.inertia * [[[1]], [[0]]]))
    with pytest.raises(InputError, match='robot "two_link": its joints can move so that no mass moves'):
        forward_dynamics(light, *np.zeros((3, 2)), DOWN)
