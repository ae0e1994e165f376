"""The controls of a simulated arm on the page."""

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Bounded
from catenary.units import DISPLAY
from catenary.view.controls import (
    ButtonsControl,
    ChoiceControl,
    Control,
    ControlTab,
    SliderControl,
    ToggleControl,
)
from catenary.view.motions import finite_ranges
from catenary.view.surroundings import FAULTS, MOST_FRICTION

GOTO = "goto:"  # begins the name of a joint's slider
REST, GO_TO, RANDOM, ZIGZAG = "rest", "go to the sliders", "random motion", "zig-zag"
MOTIONS = (REST, GO_TO, RANDOM, ZIGZAG)
ENABLE, PAUSE, HOME = LEVELS = ("enable", "pause", "home")
OWN = "the robot's own position control"
CONTROLLERS = {
    "PD alone": "pd",
    "PD + gravity of a level base (SG)": "sg",
    "PD + sensed gravity (DG)": "dg",
    "gravity compensation alone": "hold",
    OWN: "own",
}


def driving_tabs(
    limits: Bounded, q: Floats, *, motion: str, controller: str, has_cables: bool, has_model: bool
) -> tuple[ControlTab, ...]:
    """Return the tabs of an arm's page: its motion, its surroundings, its model.

    Args:
        limits: Of the joints.
        q: (n,) where they stand [rad|m].
        motion: One of MOTIONS, picked at first.
        controller: A key of CONTROLLERS, likewise.
        has_cables: It is a RAVEN-II.
        has_model: A calibration model goes with it.
    """
    drive = ControlTab(
        "Drive",
        (
            ButtonsControl("level", "run level", LEVELS, "Home: against the stops, as a real RAVEN-II does."),
            ChoiceControl("motion", "motion", MOTIONS, motion),
            ChoiceControl("controller", "controller", tuple(CONTROLLERS), controller),
            *joint_sliders(limits, q),
        ),
    )
    world: list[Control] = [
        SliderControl("roll_deg", "base roll [deg]", -90.0, 90.0, 1.0, 0.0, "About x."),
        SliderControl("pitch_deg", "base pitch [deg]", -90.0, 90.0, 1.0, 0.0, "Then about the base's own y."),
        SliderControl("rocking_deg", "rocking, to either side [deg]", 0.0, 20.0, 0.5, 0.0, "About x."),
        SliderControl("rocking_hz", "rocking [Hz]", 0.1, 2.0, 0.1, 0.5),
        SliderControl("payload_kg", "payload [kg]", 0.0, 1.0 if has_cables else 5.0, 0.05, 0.0,
                      "The controller does not know of it."),
        ChoiceControl("sensor", "gravity sensor's fault", tuple(FAULTS), "none"),
        SliderControl("friction", "Coulomb friction, x its own" if has_cables else "Coulomb friction",
                      0.0, MOST_FRICTION, 0.1, 1.0 if has_cables else 0.0),
    ]  # fmt: skip
    if has_cables:
        world.append(
            SliderControl(
                "wear", "cable wear [share]", 0.0, 1.0, 0.05, 0.0, "Stretch that stays, stiffness lost."
            )
        )
    tabs = [drive, ControlTab("Surroundings", tuple(world))]
    if has_model:
        text = "The calibrated arm shows where the model says that the joints are. Switched on, the loop goes by it."
        switch = ToggleControl("model", "the loop goes by the model", False)
        tabs.append(ControlTab("Model", (switch,), text))
    return tuple(tabs)


def joint_sliders(limits: Bounded, q: Floats) -> list[Control]:
    """Return a slider for each joint [deg|mm]."""
    found: list[Control] = []
    ranges = finite_ranges(limits)
    for j, (name, unit) in enumerate(zip(limits.joint_names, limits.joint_units, strict=True)):
        shown, scale = DISPLAY[unit]
        # whole steps inside the limits
        low = float(np.ceil(10.0 * scale * ranges.lower[j]) / 10.0)
        high = float(np.floor(10.0 * scale * ranges.upper[j]) / 10.0)
        value = float(np.clip(round(scale * float(q[j]), 1), low, high))
        found.append(SliderControl(f"{GOTO}{name}", f"{name} [{shown}]", low, high, 0.1, value))
    return found
