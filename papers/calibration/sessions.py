"""Sessions of six hours: zig-zags first, then random motion or brakes, recorded from one robot in one condition.

Peng et al., II-G. Each zig-zag of J2-J3 is recorded once, finest last, and combinations join these recordings. Tests
are sampled twice a second: swings last ten seconds and more, and no model here has a memory. Idle tests take 20
minutes, as all other tests of the paper do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from catenary import CablePlant, MotionLog, random_sinusoids, record_simulated
from papers.calibration.inputs import STAMP
from papers.calibration.recordings import TEST_SECONDS, calibration_log, draws, homed

Condition = Literal["idle", "unloaded", "loaded"]
CONDITIONS: tuple[Condition, ...] = ("idle", "unloaded", "loaded")
HOURS = {"idle": (0, 5), "unloaded": tuple(range(6)), "loaded": tuple(range(6))}  # tested
PAYLOAD = 0.5  # [kg]
HOUR = 3600.0
BRAKED = 300.0  # [s] of the hours on brakes that are simulated, five times the slowest time constant
TEST_RATE = 2.0  # [Hz]
DENOMINATORS = (2, 3, 4, 5, 6)  # of the sparsities


@dataclass(frozen=True)
class Session:
    """Recordings of one robot in one condition."""

    train: dict[int, MotionLog]  # by the sparsity's denominator
    test: dict[int, MotionLog]  # by hour

    def training(self, name: str) -> list[MotionLog]:
        """Return the recordings of a training set, "1/2+1/3"."""
        return [self.train[n] for n in denominators(name)]


def denominators(name: str) -> list[int]:
    """Return 2 and 3 for "1/2+1/3"."""
    return [int(part.removeprefix("1/")) for part in name.split("+")]


def recorded(
    seed: int | None,
    condition: Condition,
    *,
    zigzags: Sequence[int] = DENOMINATORS,
    hour_seconds: float = HOUR,
    columns: Sequence[str] = (),
    test_rate: float = TEST_RATE,
) -> Session:
    """Record a session: the zig-zags, 1/n for every n, then six hours.

    Args:
        columns: Further ones of the robot's state; its other arm holds its setpoint meanwhile, and is in them.
        test_rate: [Hz] at which tests are sampled; the robot's motion does not depend on it.
    """
    number = CONDITIONS.index(condition)
    plant = homed(seed, payload=PAYLOAD if condition == "loaded" else 0.0)
    beside = homed(seed, side="right") if columns else None
    train = {
        n: _stamped(
            calibration_log(plant, draws(seed, 20 + number, n), sparsities=(1.0 / n,), columns=columns, beside=beside)
        )
        for n in zigzags
    }

    def motion(seconds: float, *what: int) -> MotionLog:
        rng = draws(seed, 30 + number, *what)
        path = random_sinusoids(rng, seconds)
        return _stamped(
            record_simulated(plant, path, "random", rng, state_rate=test_rate, columns=columns, beside=beside)
        )

    if condition == "idle":
        seconds = min(TEST_SECONDS, hour_seconds)
        first = motion(seconds, 0)
        _stand(plant, min(BRAKED, hour_seconds))
        return Session(train, {0: first, 5: motion(seconds, 5)})
    return Session(train, {hour: motion(hour_seconds, hour) for hour in range(6)})


def _stamped(log: MotionLog) -> MotionLog:
    """Return a recording with its rows' time since its beginning as a signal: the authors' stamps begin at 0."""
    stamp = np.asarray(log.time) - np.asarray(log.time)[0]
    return replace(log, signals={**log.signals, STAMP: stamp}, signal_units={**log.signal_units, STAMP: "s"})


def _stand(plant: CablePlant, seconds: float) -> None:
    """Let the brakes hold."""
    plant.state_command("pause")
    for _ in range(round(seconds / plant.period)):
        plant.wait()
    plant.state_command("resume")
