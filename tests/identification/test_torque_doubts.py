"""Recordings spoilt by a known amount, against notes that say so."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.identification.torque_doubts import course_findings, fitted_gravity, mounting_finding
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from catenary.workflows.identify import identify_files
from moving_arm import recorded, write_npz
from oracles.geared_arm import ur10_log, write_ur10

ARM = load_robot("raven2")
PLAIN = IdentifyOptions(consistent=False, friction=())
ROWS = 6000
LATER = (np.arange(ROWS) >= 0.4 * ROWS)[:, None]
ELBOW = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def run() -> MotionLog:
    return recorded(ARM, 0, noise=0.1)


@pytest.fixture(scope="module")
def heavier() -> Floats:
    """The same run of an arm with a heavier last link."""
    inertia = ARM.tree.mass * np.array([1.0] * (len(ARM.tree.mass) - 1) + [2.0])
    return np.array(recorded(replace(ARM, tree=ARM.tree._replace(mass=inertia)), 0, noise=0.1).tau)


def said(log: MotionLog) -> list[str]:
    samples = prepare(log, ARM, PLAIN)
    return [str(each) for each in course_findings(identify([log], ARM, PLAIN), samples)]


def test_untouched_torques_are_not_doubted(run: MotionLog) -> None:
    assert said(run) == []
    assert said(recorded(ARM, 1)) == []  # to the last digit


@pytest.mark.alike
@pytest.mark.parametrize("rows", [-8, 4, 10, 20])
def test_late_and_early_torques_are_named_with_their_time(run: MotionLog, rows: int) -> None:
    (says,) = said(replace(run, tau=np.roll(np.array(run.tau), rows, axis=0)))  # at 200 Hz; filters cut the ends
    assert f"{abs(rows) * 5} ms too {'late' if rows > 0 else 'early'}" in says


@pytest.mark.parametrize(
    ("spoil", "name"),
    [
        (lambda tau: tau + 5.0 * LATER * ELBOW, r"elbow: the zero of its torque leaps by \+(4.9|5|5.1) Nm at about 12"),
        (lambda tau: tau - np.linspace(0.0, 4.0, ROWS)[:, None] * ELBOW, "elbow: the zero of its torque drifts by -"),
        (lambda tau: tau * (1.0 - 2.0 * LATER * ELBOW), "elbow: the sign of its torque turns at about 12"),
    ],
)  # fmt: skip
def test_torques_that_change_along_a_recording_are_named(
    run: MotionLog, spoil: Callable[[Floats], Floats], name: str
) -> None:
    (says,) = said(replace(run, tau=spoil(np.array(run.tau))))
    assert re.match(name, says)


def test_a_load_taken_up_on_the_way_is_named(run: MotionLog, heavier: Floats) -> None:
    (says,) = said(replace(run, tau=np.where(LATER, heavier, np.array(run.tau))))
    assert f"the load on {ARM.tip} changes at about 12" in says


def test_wrong_stamps_and_tests_among_what_was_fitted_are_noted(tmp_path: Path, run: MotionLog) -> None:
    write_npz(run, tmp_path / "run.npz", t=np.array(run.time) * 1.25)
    write_npz(run.part(1000, 5000), tmp_path / "cut.npz")
    notes = identify_files([tmp_path / "run.npz"], "raven2", PLAIN, tests=[tmp_path / "cut.npz"]).notes
    assert any("velocities are 1.25 times the derivatives" in note for note in notes)
    assert any("cut: 100% of its motion is in the data twice" in note for note in notes)


LEVEL = np.array([0.0, 0.0, -9.81])
OPTIONS = IdentifyOptions()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_urdf(write_ur10(tmp_path_factory.mktemp("ur10")))


@pytest.mark.alike
@pytest.mark.parametrize(
    ("gravity", "said", "option"),
    [
        ((9.81, 0.0, 0.0), "on a wall, its x axis down", "9.81,0,0"),
        ((0.0, -9.81, 0.0), "on a wall, its y axis up", "0,-9.81,0"),
        ((0.0, 0.0, 9.81), "hangs from a ceiling", "0,0,9.81"),
        ((6.937, 0.0, -6.937), "tilted, 45 deg", "6.9"),
    ],
)
def test_the_mounting_that_fits_is_named(arm, gravity, said, option):
    samples = prepare(ur10_log(0, gravity=gravity), arm, OPTIONS)
    finding = mounting_finding(arm, samples)
    assert finding is not None
    assert finding.name == "gravity"
    assert said in finding.says
    assert finding.remedy.startswith(f"--gravity {option}")
    assert mounting_finding(arm, replace(samples, gravity=np.array(gravity))) is None
    found = fitted_gravity(arm, samples)
    assert found is not None
    assert (np.abs(found[0] - gravity) < 0.1).all()


@pytest.mark.parametrize("spoil", [np.ones(6), np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0]), -np.ones(6)])
def test_torques_of_a_wrong_sign_are_no_mounting(arm, spoil):
    log = ur10_log(0)
    assert mounting_finding(arm, prepare(replace(log, tau=spoil * log.tau), arm, OPTIONS)) is None


def test_poses_at_rest_on_a_wall_are_named_and_turned_torques_are_left_to_the_sign():
    raven, rng = load_robot("raven2"), np.random.default_rng(0)
    q = rng.uniform(raven.lower, raven.upper, (300, 3))
    static = IdentifyOptions(terms="static")
    for gravity, turned, named in (([0.0, 9.81, 0.0], 1.0, True), (LEVEL, 1.0, False), (LEVEL, -1.0, False)):
        tau = turned * gravity_torque(raven, q, gravity) + rng.normal(0.0, 0.05, q.shape)
        log = recorded(raven, 0, q_nominal=q, qd=None, time=None, tau=tau, ok=np.ones(300, dtype=bool))
        assert (mounting_finding(raven, prepare(log, raven, static)) is not None) == named
