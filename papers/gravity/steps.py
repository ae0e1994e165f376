"""Steps of the reference and of the base: what the gravity paper leaves to future work.

Lewis and Hannaford 2014, section VII: "The step-response of the PD+DG controller under these conditions would provide
an interesting study": perturbations of the base, sustained accelerations. It claims nothing of them. Three events,
described in `events.py`: a step of joint 1's reference on a tilted base, a base that tilts, a base that drives off.

Errors are desired minus reported position; changes are against just before the event.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from papers.claims import mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, TitledPicture, run
from papers.figures import COLORS, LABELS, panels
from papers.gravity.events import (
    ACCELERATION,
    EVENTS,
    STEP_BASE_DEG,
    STEP_DEG,
    TILT_DEG,
    TILT_SECONDS,
    Event,
    homed,
    respond,
)
from papers.kit import filled, grid, rows, sample, table

CONTROLLERS = ("pd", "sg", "dg", "attitude")
TITLES: dict[Event, str] = {
    "reference": f"reference steps by {STEP_DEG:g} deg",
    "tilt": f"base turns by {TILT_DEG:g} deg",
    "drive": f"base drives off at {ACCELERATION:g} m/s2",
}


@run(revision=1)
def responses(*, seed: int | None, event: Event) -> Result:
    """Let an event happen to a robot under each controller; return joint 1's response to it by controller."""
    plant = homed(event, seed=seed)
    # tilt alone is another vector than the sensor's only where the base accelerates
    names = [name for name in CONTROLLERS if name != "attitude" or event == "drive"]
    return {name: respond(plant, event, name).plain() for name in names}


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot and event."""
    events: tuple[Event, ...] = ("tilt",) if scope.quick else EVENTS
    return grid(responses, {"seed": scope.robots, "event": events})


def report(o: Outcomes) -> Report:
    """Return how joint 1 follows the step of its reference, and what its base's motion does to it."""

    def row(event: Event, name: str, numbers: Sequence[str]) -> list[str]:
        return [mean_and_spread(each) for each in (sample(o, responses, name, n, event=event) for n in numbers)]

    def step(name: str) -> list[str]:
        return [LABELS[name], *row("reference", name, ("before", "rise_time", "overshoot", "last_error"))]

    def of_base(event: Event, name: str) -> list[str]:
        return [f"{TITLES[event]}, {LABELS[name]}", *row(event, name, ("before", "largest", "final"))]

    tables = [
        table(
            f"Step of joint 1's reference by {STEP_DEG:g} deg, base at {STEP_BASE_DEG:g} deg",
            "controller | error before [deg] | 10 to 90 % [s] | overshoot [deg] | error at the end [deg]",
            rows(step, CONTROLLERS),
        ),
        table(
            f"Joint 1 while its base turns from 0 to {TILT_DEG:g} deg in {TILT_SECONDS:g} s, or accelerates by "
            f"{ACCELERATION:g} m/s2 along x",
            "event, controller | error before [deg] | largest change [deg] | final change [deg]",
            rows(of_base, EVENTS[1:], CONTROLLERS),
        ),
    ]
    caption = "Joint 1, nominal robot: its motion in the step, its error where the base moves"
    return Report(filled(tables), [TitledPicture(caption, _picture(o))])


def _picture(o: Outcomes) -> Any:
    found = {event: results[0] for event in EVENTS if (results := o.of(responses, event=event))}
    figure, parts = panels(max(len(found), 1), 3.6)
    labelled: dict[str, Any] = {}
    for axes, (event, by_name) in zip(parts, found.items(), strict=False):
        for name, row in by_name.items():
            # PD+SG and the true attitude's term are the same on a level base
            style = "--" if name == "attitude" else "-"
            line = row["moved" if event == "reference" else "error"]
            labelled[LABELS[name]] = axes.plot(row["time"], line, style, color=COLORS[name], lw=1.2)[0]
        if event == "reference":
            one = next(iter(by_name.values()))
            wanted = np.array(one["error"]) + one["moved"]
            labelled["reference"] = axes.plot(one["time"], wanted - wanted[0], ":", color="#7a8699", lw=1.2)[0]
        axes.set_title(TITLES[event], fontsize=10)
        axes.set_ylabel("joint 1 moved [deg]" if event == "reference" else "error of joint 1 [deg]")
        axes.set_xlabel("time since it began [s]")
    form: dict[str, Any] = {
        "frameon": False,
        "fontsize": 8,
        "ncols": max(len(labelled), 1),
        "loc": "outside lower center",
    }
    figure.legend(labelled.values(), labelled.keys(), **form)
    return figure


EXPERIMENT = Experiment(
    "gravity-steps", "section VII", "Steps of the reference and of the base", __doc__, cases, report, minutes=6.0
)
