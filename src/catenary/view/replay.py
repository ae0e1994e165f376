"""A recording played on the page: a time line to scrub, its speed, and the way to its largest error."""

import time
from collections.abc import Callable

import numpy as np

from catenary.view.controls import (
    ButtonsControl,
    Change,
    ChoiceControl,
    ControlTab,
    SliderControl,
    ToggleControl,
    Value,
)
from catenary.view.page_process import StatePage
from catenary.view.recorded import RecordedArm
from catenary.view.shapes import ArmShapes, arm_shapes
from catenary.view.shown import Shown

SPEEDS = ("1/4", "1", "4", "16", "64")
EVERY = 0.04  # [s] between two states
NOW = 0.25  # [s] between two places of the time line's slider


class Replay:
    """A recording, where it is being played, and how fast."""

    def __init__(self, arm: RecordedArm, shapes: ArmShapes | None = None) -> None:
        """Begin at the first row, playing; without shapes the arm is drawn from its kinematics."""
        self._arm = arm
        self._shapes = arm_shapes(arm.model) if shapes is None else shapes
        self._now = float(arm.time[0])  # [s]
        self._speed, self._plays = 1.0, True
        self._told = -np.inf
        self._values: dict[str, Value] = {}

    def shown(self, title: str) -> Shown:
        """Return what its page shows."""
        arm, end = self._arm, float(self._arm.time[-1])
        legend = {"reported": "reported"}
        if np.isfinite(arm.calibrated).any():
            legend["calibrated"] = "calibrated"
        if np.isfinite(arm.true).any():
            legend["true"] = "measured"
        step = max(round(end / 2000.0, 2), 0.01)
        controls = (
            ToggleControl("plays", "play", True),
            SliderControl("time", "time [s]", 0.0, max(step, float(np.ceil(end / step)) * step), step, 0.0),
            ChoiceControl("speed", "speed", SPEEDS, "1"),
        )
        worst = tuple(arm.model.joint_names[j] for j in arm.joints)
        if "true" in legend:
            controls = (*controls, ButtonsControl("worst", "largest error of", worst))  # type: ignore[assignment]
        text = "The curves show 15 s before and after now."
        return Shown(
            title, arm.model, self._shapes, (ControlTab("Recording", controls, text),), arm.q[0], legend,
            arm.columns(),
        )  # fmt: skip

    def run(
        self,
        page: StatePage,
        ended: Callable[[], bool] = lambda: False,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Play until the page is gone or `ended` says so; at its end the recording begins again."""
        before = clock()
        while page.is_running and not ended():
            for change in page.changes():
                self.take(change)
            now = clock()
            if self._plays:
                self._now += self._speed * (now - before)
                if self._now > self._arm.time[-1]:
                    self._now = 0.0
            before = now
            self._tell_time(now)
            row = int(np.searchsorted(self._arm.time, self._now, side="right")) - 1
            page.put(self._arm.state(max(row, 0))._replace(values=dict(self._values)))
            sleep(EVERY)

    def take(self, change: Change) -> None:
        """Do what somebody wants."""
        name, value = change
        if name == "plays":
            self._plays = bool(value)
        elif name == "time":
            self._now = float(np.clip(float(value), 0.0, self._arm.time[-1]))
        elif name == "speed" and value in SPEEDS:
            self._speed = 0.25 if value == "1/4" else float(value)
        elif name == "worst" and value in self._arm.model.joint_names:
            row = self._arm.worst_row(self._arm.model.joint_names.index(str(value)))
            if row is not None:
                self._now, self._plays = float(self._arm.time[row]), False
                self._values["plays"] = False
                self._values["time"] = round(self._now, 2)

    def _tell_time(self, now: float) -> None:
        """Move the time line's slider along, now and then."""
        if self._plays and now - self._told >= NOW:
            self._told = now
            self._values = {"time": round(self._now, 2)}
