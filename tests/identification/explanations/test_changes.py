"""Recordings spoilt by a known amount, against notes that say so."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.identification.explanations.findings import explained_torques
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.workflows.identify import identify_files
from moving_arm import recorded, write_npz

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


def messages(log: MotionLog) -> list[str]:
    return [str(each) for each in explained_torques(ARM, prepare(log, ARM, PLAIN))[0] if each.name != "short"]


def test_untouched_torques_are_not_doubted(run: MotionLog) -> None:
    assert messages(run) == []
    assert messages(recorded(ARM, 1)) == []  # to the last digit


@pytest.mark.parametrize(
    ("spoil", "name"),
    [
        (lambda tau: tau + 5.0 * LATER * ELBOW, r"elbow: the zero of the torque of elbow leaps by \+(4.9|5|5.1) Nm at about 12"),
        (lambda tau: tau - np.linspace(0.0, 4.0, ROWS)[:, None] * ELBOW, "elbow: the zero of the torque of elbow drifts by -[34]"),
        (lambda tau: tau * (1.0 - 2.0 * LATER * ELBOW), "elbow: the sign of the torque of elbow turns at about 12"),
    ],
)  # fmt: skip
def test_torques_that_change_along_a_recording_are_named(
    run: MotionLog, spoil: Callable[[Floats], Floats], name: str
) -> None:
    (says,) = messages(replace(run, tau=spoil(np.array(run.tau))))
    assert re.match(name, says)


def test_a_load_taken_up_on_the_way_is_named(run: MotionLog, heavier: Floats) -> None:
    (says,) = messages(replace(run, tau=np.where(LATER, heavier, np.array(run.tau))))
    assert f"the load on {ARM.tip} changes at about 12" in says


def test_wrong_stamps_and_tests_among_what_was_fitted_are_noted(tmp_path: Path, run: MotionLog) -> None:
    write_npz(run, tmp_path / "run.npz", t=np.array(run.time) * 1.25)
    write_npz(run.part(1000, 5000), tmp_path / "cut.npz")
    notes = identify_files([tmp_path / "run.npz"], "raven2", PLAIN, tests=[tmp_path / "cut.npz"]).notes
    assert any("velocities are 1.25 times the derivatives" in note for note in notes)
    assert any("cut: 100% of its motion is in the data twice" in note for note in notes)
