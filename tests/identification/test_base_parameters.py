import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.regressor import link_parameters
from catenary.identification.base_parameters import base_parameters
from catenary.identification.columns import Parameters
from catenary.robots.catalog import load_robot
from moving_arm import LEVEL, sinusoids


def base_of(model, terms="full", gravity=LEVEL):
    recorded = sinusoids(np.random.default_rng(5), model, np.linspace(0.0, 3.0, 200))
    if terms == "static":
        recorded = (recorded[0], np.zeros_like(recorded[0]), np.zeros_like(recorded[0]))
    return base_parameters(
        Parameters(model, terms), np.asarray(gravity, dtype=float), recorded, np.random.default_rng(6)
    )


@pytest.mark.parametrize(
    ("name", "count"),
    [
        # published by Wang et al. 2019, and Gaz et al. 2019 (43 inertial, 21 friction)
        ("dvrk_psm", 49),
        ("dvrk_mtm", 73),
        ("panda", 64),
        # a planar 3R: I, mcx, mcy per link less what is the same about parallel axes (Khalil, Dombre 2002), 9 friction
        ("planar_3r", 9 + 9),
    ],
)
def test_as_many_base_parameters_as_are_published(name, count):
    assert base_of(load_robot(name)).count == count


def test_a_vertical_first_axis_hides_two_gravity_parameters_that_a_tilted_base_shows():
    model = load_robot("panda")
    level, tilted = base_of(model, "static"), base_of(model, "static", [1.0, 2.0, -9.0])
    assert tilted.count == level.count + 2


def test_base_parameters_give_the_torques_of_all_parameters():
    model = load_robot("raven2")
    base = base_of(model)
    rng = np.random.default_rng(7)
    phi = np.concatenate([link_parameters(model.tree), rng.normal(size=9)])
    q, qd, qdd = sinusoids(rng, model, np.linspace(0.0, 2.0, 50))
    whole = base.parameters.regressor(q, qd, qdd, LEVEL) @ phi
    assert_allclose(base.regressor(q, qd, qdd, LEVEL) @ (base.combination @ phi), whole, atol=1e-9)


def test_a_base_parameter_is_written_as_the_sum_it_is():
    base = base_of(load_robot("two_link"))
    texts = [base.describe(i) for i in range(base.count)]
    # under gravity the second link's mass acts at the first's end, 1 m along x: only their sum shows
    assert any("mcx link0" in text and "m link1" in text for text in texts)
    assert len(set(base.names)) == base.count == len(base.units)


def test_massless_links_have_no_parameters():
    parameters = Parameters(load_robot("raven2_full"), "full")
    assert all("tool" not in name and "wrist" not in name for name in parameters.names[:30])
    assert len(parameters.links) == 3


def test_at_rest_only_masses_first_moments_constants_and_springs_show():
    names = Parameters(load_robot("dvrk_mtm"), "static").names
    assert {name.split()[0] for name in names} == {"m", "mcx", "mcy", "mcz", "offset", "spring"}
