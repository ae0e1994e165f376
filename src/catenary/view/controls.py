"""What a page has to press, pull and choose, as data: the page draws it, and says what was changed."""

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


Control = SliderControl | ChoiceControl | ToggleControl | ButtonsControl


@dataclass(frozen=True)
class ControlTab:
    """Controls that are shown together."""

    label: str
    controls: tuple[Control, ...]
    text: str = ""  # above them
