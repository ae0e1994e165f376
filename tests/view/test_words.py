import numpy as np

from catenary.view.shapes import arm_shapes
from catenary.view.shown import Shown
from catenary.view.words import gravity_html, joints_html, status_html
from view.arms import RAVEN, Q, state


def test_joints_are_told_in_degrees_and_millimetres_with_their_interval() -> None:
    legend = {"reported": "reported", "calibrated": "calibrated"}
    shown = Shown("x", RAVEN, arm_shapes(RAVEN), legend=legend)
    told = joints_html(shown, state(calibrated=Q, interval=np.full(3, 0.001), inside=np.array([1.0, 1.0, 0.0])))
    assert "400.00 \u00b1 1.00?" in told
    assert "40.11" in told  # 0.7 rad


def test_what_comes_from_a_file_is_text_and_no_markup() -> None:
    told = status_html(state(mode="<script>alert(1)</script>", warnings=("<img src=x onerror=y>",)))
    assert "<script" not in told
    assert "<img" not in told


def test_gravity_is_told_with_the_angle_between_measured_and_assumed() -> None:
    down, side = np.array([0.0, 0.0, -9.81]), np.array([0.0, 9.81, 0.0])
    told = gravity_html(state(gravity=side, assumed=down, gravity_age=0.004))
    assert "90.0 deg apart" in told
    assert "4 ms ago" in told
