"""What browsers set on a page, as the program behind it is told."""

from collections.abc import Iterator

import pytest

from catenary.view.page_process import PageProcess
from catenary.view.shown import NOBODY, Change
from patience import until
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
    ("the loop goes by the model", "on", Change("model", True)),
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
    assert {change for change in found if change.name not in ("rocking_hz", NOBODY.name)} == {expected} - {None}
    other.wait(lambda: other.values["rocking [Hz]"] == marker)  # by then it was sent what was asked for
    if label != "run level":  # buttons show nothing
        other.wait(lambda: other.values[label] == (before if expected is None else expected.value))
