import contextlib
import io
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from papers.gravity.static import Results, main

pytestmark = pytest.mark.slow
POSES = (5.0, 85.0)


class Ran(NamedTuple):
    results: Results
    folder: Path
    printed: str


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("static")
    with contextlib.redirect_stdout(io.StringIO()) as out:
        results = main(folder, (None,), (0, 25), POSES)
    return Ran(results, folder, out.getvalue())


def test_placed_arm_needs_no_pd_with_sensed_gravity_and_much_with_nominal_one(ran: Ran) -> None:
    tilted = ran.results[None, "placed", 25]
    assert tilted["dg"].share[0] < 0.15
    assert tilted["sg"].share[0] > 0.40
    assert tilted["pd"].share[0] == pytest.approx(1.0)


def test_on_a_level_base_nominal_gravity_is_the_sensed_one(ran: Ran) -> None:
    for approach in ("placed", "driven"):
        level = ran.results[None, approach, 0]
        np.testing.assert_allclose(level["sg"].torque, level["dg"].torque, atol=1e-12)
    assert ran.results[None, "placed", 0]["sg"].share[0] < 0.15


def test_driven_arm_leaves_its_friction_to_the_pd(ran: Ran) -> None:
    tilted = ran.results[None, "driven", 25]
    # 0.15 + 0.16 Nm and a tenth of the load, of 2 to 3 Nm
    assert tilted["dg"].share[0] < 0.25
    assert tilted["sg"].share[0] > 0.40


def test_compensated_joint_stands_nearer_to_its_reference(ran: Ran) -> None:
    for approach in ("placed", "driven"):
        tilted = ran.results[None, approach, 25]
        assert tilted["dg"].rms_error[0] < tilted["sg"].rms_error[0] < tilted["pd"].rms_error[0]


def test_page_and_data_hold_every_run(ran: Ran, written) -> None:
    results, page = written(ran.folder, "gravity_static")
    assert {(row["approach"], row["base_deg"], row["controller"]) for row in results} == {
        (a, b, c) for a in ("placed", "driven") for b in (0, 25) for c in ("pd", "sg", "dg")
    }
    assert "PD share of joint 1, placed" in ran.printed
    assert "figure 8" in page
