"""A simulated plant at the speed of the clock."""

import time
from typing import Any

from catenary.plant import Plant


class PacedPlant:
    """A simulated plant whose ticks take as long as a robot's; time lost by a late tick is not caught up.

    Every other verb is the plant's own.
    """

    def __init__(self, plant: Plant) -> None:
        """Take a plant; its clock starts with the first tick."""
        self._plant = plant
        self._next: float | None = None
        self.late = 0  # ticks that began a whole period late or more

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def wait(self) -> None:
        """Advance the simulation, then sleep until the tick is over."""
        begin = time.monotonic()
        self._plant.wait()
        now = time.monotonic()
        period = self._plant.period
        if self._next is None or begin > self._next + period:
            self.late += self._next is not None
            self._next = begin
        self._next += period
        if self._next > now:
            time.sleep(self._next - now)
