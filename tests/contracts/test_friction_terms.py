"""What every friction term owes, in units, bounds, Python, C, files, `identify` and pages: `FRICTION_TERMS` has them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.config import parse_settings, plain_data
from catenary.dynamics.actuation_loads import ActuationLoads, actuation_columns
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.identification.base_parameters import Parameters
from catenary.identification.identification import identify
from catenary.identification.identify_options import FRICTION_PARTS, IdentifyOptions
from catenary.identification.samples import path_load
from catenary.robots.actuation import Actuation, Friction, actuation_terms
from catenary.robots.catalog import load_robot
from catenary.robots.friction_terms import FRICTION_TERMS
from catenary.workflows.c_header import c_header
from compiled_c import output_of, prefix_of, puts
from documented import ROOT
from moving_arm import LEVEL, recorded, sinusoids

ARM = load_robot("raven2")  # two joints that turn, one that slides
UNIT_OF_POWER = {0: ("Nm", "N"), 1: ("Nm s/rad", "N s/m"), 2: ("Nm s2/rad2", "N s2/m2")}
SCALE = {"speed": 0.3, "travel": 0.02}
NONE = dict.fromkeys(FRICTION_TERMS, None) | {
    kind: False for kind, term in FRICTION_TERMS.items() if term.scale is None
}
every_term = pytest.mark.parametrize("term", FRICTION_TERMS.values(), ids=FRICTION_TERMS)


def given(term):
    """What a robot file says of a term that is there: true, or its scale."""
    return True if term.scale is None else SCALE[term.scale.of]


def friction_of(term, beside=(), **changes):
    """An arm whose joints have a term of friction, and others."""
    kinds = {term.kind: given(term)} | dict.fromkeys(beside, True)
    rows = zip(ARM.joint_names, np.eye(ARM.n), strict=True)
    return Actuation(friction=tuple(Friction(*row, **NONE | kinds) for row in rows), **changes)


def power_of(term):
    """Of the rate in a term's load: how it grows where all speeds double, its own included."""
    speed_scale = term.scale is not None and term.scale.of == "speed"
    one, two = (term.load(np.array([k * 0.7]), (k if speed_scale else 1) * 0.4, 0.0, np) for k in (1.0, 2.0))
    return round(float(np.log2(np.divide(two, one)).max()), 9)


@every_term
def test_the_unit_is_torque_over_the_power_of_speed_that_the_law_has(term):
    units = Parameters(replace(ARM, actuation=friction_of(term)), "full").units[-ARM.n :]
    turns, slides = ("", "") if term.grows_with_load else UNIT_OF_POWER[int(power_of(term))]
    assert units == (turns, turns, slides)


@every_term
def test_friction_within_its_bounds_never_drives_a_joint(term, rng):
    actuation = friction_of(term, [term.beside] if term.beside else ())
    parameters = Parameters(replace(ARM, actuation=actuation), "full")
    rates = rng.normal(size=(200, ARM.n))
    values = rng.normal(size=(500, len(parameters.actuation)))
    bounds = parameters.bounds[:, -values.shape[1] :]
    columns = actuation_columns(parameters.actuation, rates, rates, rates, 0.0, carried=rates)
    power = np.einsum("ri,rik,vk->vr", rates, columns, values[(values @ bounds.T >= 0.0).all(axis=1)])
    assert len(power)
    assert term.at_rest or (power >= -1e-12).all()


@every_term
@pytest.mark.parametrize("smooth", [0.0, 0.05])
def test_compiled_c_asks_what_inverse_dynamics_and_the_law_do(term, smooth, rng, tmp_path):
    actuation = friction_of(term, coulomb_velocity=smooth)
    loads = ActuationLoads(ARM.n, actuation, actuation_terms(actuation), np.full(ARM.n, 0.3))
    q, qd, qdd = (values[::300] for values in sinusoids(rng, ARM, np.arange(3000) / 100.0))
    links = inverse_dynamics(ARM, q, qd, qdd, LEVEL)
    law = 0.3 * term.load(qd, loads.terms[0].scale, smooth, np) * (np.abs(links) if term.grows_with_load else 1.0)
    assert_allclose(loads.torque(q, qd, qdd, links), np.broadcast_to(law, q.shape), atol=1e-12)
    assert_allclose(inverse_dynamics(ARM, q, qd, qdd, LEVEL, loads=loads), links + law, atol=1e-10)
    header = c_header(ARM, None, loads=loads)
    body = (
        f"double out[3]; LOOP  {prefix_of(header.text)}_feedforward(r, r + 3, r + 6, r + 9, 0, 0, out);\n{puts(out=3)}"
    )
    rows = np.column_stack([q, qd, qdd, np.tile(LEVEL, (len(q), 1))])
    assert_allclose(output_of(header.text, body, rows, tmp_path, "C99"), links + law, atol=1e-10)
    assert any(f"{term.kind} friction" in note for note in header.notes) == (term.memory is not None)


@every_term
def test_it_is_found_in_files_as_it_was_written(term):
    actuation = friction_of(term)
    record = plain_data(actuation)
    assert record["friction"][0][term.scale.key if term.scale else term.kind] == given(term)
    again = parse_settings(record, Actuation, "robot")
    assert [friction.parts for friction in again.friction] == [friction.parts for friction in actuation.friction]
    assert term.usual == (term.kind in Friction("on every joint", np.ones(1)).parts)


@pytest.mark.alike
@every_term
def test_identify_recovers_its_coefficient_from_a_recording(term):
    actuation = friction_of(term, {term.beside, "viscous"} - {"", term.kind})
    arm = replace(ARM, actuation=actuation)
    terms = actuation_terms(actuation)
    q, qd, qdd = sinusoids(np.random.default_rng(0), ARM, np.arange(6000) / 200.0)
    links = inverse_dynamics(ARM, q, qd, qdd, LEVEL)
    columns = actuation_columns(terms, q, qd, qdd, 0.0, links)
    for k, own in enumerate(terms):
        if own.friction.memory is not None:
            columns[:, :, k] = path_load(own.friction.memory, q @ own.combination, own.scale)[:, None] * own.combination
    noise = 0.01 * np.random.default_rng(1).normal(size=q.shape)
    log = recorded(ARM, 0, tau=links + columns @ np.full(len(terms), 0.4) + noise)
    found = identify([log], arm, IdentifyOptions(friction=())).robot().actuation
    values = [value for own, value in zip(terms, found.values, strict=True) if own.kind == term.kind]
    assert_allclose(values, 0.4, rtol=0.1)  # filtered steps and noise of 0.01 Nm


@every_term
def test_help_and_page_name_it(term):
    assert (term.kind in FRICTION_PARTS) != term.usual
    if not term.usual:
        simulated = "as Coulomb friction" if term.drive else "no"
        in_c = "as Coulomb friction" if term.memory else "yes"
        in_c += ", `NAME_friction(qd, carried, out)`" * term.grows_with_load
        row = f"| `{term.kind}` | {term.words} | {simulated} | {in_c} |"
        assert row in (ROOT / "docs" / "identification.md").read_text().splitlines()
