"""The page in a real browser: it loads, an arm is to be seen, a slider moves it, the corrected arm parts from it."""

from pathlib import Path

import numpy as np
import pytest

from view.browser import looked_at
from view.command import model_of_positions, view

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return model_of_positions(tmp_path_factory.mktemp("model") / "arm.npz")


def test_simulated_arm_is_seen_and_driven() -> None:
    with view("raven2") as url, looked_at(url) as looked:
        looked.wait_for_color(0.02, more=2, than=(0, 1))  # the blue shell of the reported arm
        looked.set_slider("shoulder [deg]", 45.0)
        looked.wait_for_joint("shoulder", 45.0, within=1.0)
        looked.set_slider("shoulder [deg]", 20.0)
        before = looked.picture()
        looked.wait_for_joint("shoulder", 20.0, within=1.0)
        looked.page.wait_for_timeout(2000)
        assert np.mean(np.abs(looked.picture() - before).max(axis=2) > 30) > 0.01  # it has moved in the picture
        assert looked.complaints == []
        assert looked.foreign == []


def test_corrected_arm_parts_from_the_reported_one(model: Path) -> None:
    with view("raven2", "--model", model) as url, looked_at(url) as looked:
        looked.page.wait_for_timeout(4000)
        # by what the encoders' zero is apart from the robot's, 7.5 deg, and what the cables give
        assert abs(looked.joint("elbow", 0) - looked.joint("elbow", 1)) > 4.0
        assert abs(looked.joint("elbow", 1) - looked.joint("elbow", 2)) < 1.5
        looked.wait_for_color(0.004, more=2, than=(0, 1))  # blue where only the reported arm is
        looked.wait_for_color(0.004, more=1, than=(0, 2))  # green where only the calibrated one is
        assert looked.complaints == []
