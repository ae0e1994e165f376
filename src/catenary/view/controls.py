"""What a page has to press, pull and choose, as data: the page draws it, and says what was changed."""

import math
from dataclasses import dataclass
from typing import NamedTuple

Value = float | bool | str


class Change(NamedTuple):
    """What somebody did on the page: the name of a control, and its new value."""

    name: str
    value: Value


@dataclass(frozen=True)
class SliderControl:
    """A number to pull."""

    name: str
    label: str  # with its unit
    low: float
    high: float
    step: float
    value: float
    hint: str = ""


@dataclass(frozen=True)
class ChoiceControl:
    """One of several."""

    name: str
    label: str
    options: tuple[str, ...]
    value: str
    hint: str = ""


@dataclass(frozen=True)
class ToggleControl:
    """On or off."""

    name: str
    label: str
    value: bool
    hint: str = ""


@dataclass(frozen=True)
class ButtonsControl:
    """Buttons beside one another; the one that is pressed is the change's value."""

    name: str
    label: str
    options: tuple[str, ...]
    hint: str = ""


@dataclass(frozen=True)
class HeldControl:
    """A button that changes something for as long as it is held: a change comes HOLD_HZ times a second."""

    name: str
    label: str
    hint: str = ""


HOLD_HZ = 20.0  # as terminals repeat a key; a dead man's switch lets go at three that are missing
NOBODY = Change("looked at", False)  # told when the last browser is gone

Control = SliderControl | ChoiceControl | ToggleControl | ButtonsControl | HeldControl


@dataclass(frozen=True)
class ControlTab:
    """Controls that are shown together."""

    label: str
    controls: tuple[Control, ...]
    text: str = ""  # above them


def accepted(control: Control, value: object) -> Value | None:
    """Return a value from a browser as the control may have it, within a slider's ends; None where it may not."""
    if isinstance(control, SliderControl):
        finite = isinstance(value, int | float) and math.isfinite(value)
        return min(max(float(value), control.low), control.high) if finite else None  # type: ignore[arg-type]
    if isinstance(control, ToggleControl | HeldControl):
        return value if isinstance(value, bool) else None
    return str(value) if value in control.options else None
