"""What browsers set on a page, as the program behind it is told."""

from collections.abc import Iterator

import numpy as np
import pytest

from catenary.view.meshes import arm_shapes
from catenary.view.page_content import Change, PageContent
from catenary.view.page_process import PageProcess
from catenary.view.viser_page import gravity_html, joints_html, status_html
from patience import until
from view.arms import RAVEN, Q, state
from view.connected import Connected, page_of_an_arm

pytest.importorskip("viser")


@pytest.fixture(scope="module")
def page() -> Iterator[PageProcess]:
    with page_of_an_arm(18530) as opened:
        yield opened


@pytest.fixture(scope="module")
def browsers(page: PageProcess) -> Iterator[tuple[Connected, Connected]]:
    """Two that look; what the one does the other sees."""
    with Connected(page.url) as looking, Connected(page.url) as other:
        yield looking, other


# what a browser makes of a control, and what is told of it (None of a value that is put back); `accepted` has its own
VALUES = [
    ("payload [kg]", 1e9, Change("payload_kg", 1.0)),
    ("payload [kg]", float("nan"), None),
    ("payload [kg]", "heavy", None),
    ("joint0 [deg]", -1e6, Change("goto:joint0", -180.0)),
    ("motion", "explode", None),
    ("motion", "zig-zag", Change("motion", "zig-zag")),
    ("run level", "pause", Change("level", "pause")),
    ("use the model in the loop", "on", Change("model", True)),
]


@pytest.mark.parametrize(("label", "value", "expected"), VALUES)
def test_value_that_a_control_cannot_have_is_bounded_or_put_back_and_never_told(
    page: PageProcess, browsers: tuple[Connected, Connected], label: str, value: object, expected: Change | None
) -> None:
    looking, other = browsers
    page.changes()
    before, seen = other.values[label], other.values["rocking [Hz]"]
    looking.set(label, value)
    marker = 1.5 if seen != 1.5 else 1.0
    looking.set("rocking [Hz]", marker)  # is told after it
    found: list[Change] = []
    until(lambda: found.extend(page.changes()) or {"rocking_hz"} <= {name for name, _ in found})
    until(lambda: found.extend(page.changes()) or expected is None or expected in found)
    assert {change for change in found if change.name != "rocking_hz"} == {expected} - {None}
    other.wait(lambda: other.values["rocking [Hz]"] == marker)  # by then it was sent what was asked for
    if label != "run level":  # buttons show nothing
        other.wait(lambda: other.values[label] == (before if expected is None else expected.value))


def test_joints_are_told_in_degrees_and_millimetres_with_their_interval() -> None:
    legend = {"reported": "reported", "calibrated": "calibrated"}
    shown = PageContent("x", RAVEN, arm_shapes(RAVEN), legend=legend)
    told = joints_html(shown, state(calibrated=Q, interval=np.full(3, 0.001), inside=np.array([True, True, False])))
    assert "400.00 \u00b1 1.00?" in told
    assert "40.11" in told  # 0.7 rad


def test_what_comes_from_a_file_is_text_and_no_markup() -> None:
    told = status_html(state(doing="<script>alert(1)</script>", notes=("<img src=x onerror=y>",)))
    assert "<script" not in told
    assert "<img" not in told


def test_gravity_is_told_with_the_angle_between_measured_and_assumed() -> None:
    down, side = np.array([0.0, 0.0, -9.81]), np.array([0.0, 9.81, 0.0])
    told = gravity_html(state(gravity=side, assumed=down, gravity_age=0.004))
    assert "90.0 deg apart" in told
    assert "4 ms ago" in told
