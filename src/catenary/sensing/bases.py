"""What a robot's base is mounted on, by name: how far, how hard and how fast each moves."""

import math
from dataclasses import dataclass

from catenary.errors import InputError

_MAX_CUTOFF_HZ, _MIN_CUTOFF_HZ = 35.0, 4.0  # windows of 0.07 and 0.6 s


@dataclass(frozen=True)
class BaseSpectrum:
    """How a base moves: how far, how hard and how fast."""

    acceleration: float = 6.0  # [m/s2] the largest, jolts included
    slow_acceleration: float = 0.0  # [m/s2] of it what lasts for seconds: heave, surge, braking; 0 for none
    slowest_hz: float = 1.0  # lowest frequency of slow accelerations
    fastest_hz: float = 1.0  # their highest
    rocking_hz: float = 3.0  # highest frequency that gravity is followed to
    turning: float = 4.0  # [rad/s] the fastest
    jolt: float = 1.0  # [m/s2] accelerations that appear from one sample to the next
    push: float = 1.4  # [m/s2] the hardest across gravity while the base does not turn; inf where that tells nothing

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0.0:
                raise InputError(f"base spectrum: {name}: expected 0 or more, got {value}")
        if not 0.0 < self.slowest_hz <= self.fastest_hz < math.inf:
            raise InputError(
                f"base spectrum: expected 0 < slowest_hz <= fastest_hz, got {self.slowest_hz} and {self.fastest_hz}"
            )

    @property
    def attitude_time(self) -> float:
        """Time over which the direction of `fade` is averaged [s]: a period of the slowest motion."""
        return 2.0 if self.slow_acceleration == 0.0 else max(2.0, 1.0 / self.slowest_hz)

    @property
    def cutoff_hz(self) -> float:
        """Cut-off that distorts the fastest motion by less than half a percent.

        A parabola over a window w shows a sine of frequency f within 0.3 % and 0.4 degrees where f w is 0.15
        (DelayFreeFilter).
        """
        from catenary.sensing.delay_free_filter import CUTOFF_BY_WINDOW  # brings NumPy

        return min(_MAX_CUTOFF_HZ, max(_MIN_CUTOFF_HZ, CUTOFF_BY_WINDOW * self.rocking_hz / 0.15))


# ours; the ship's are those of seas of 0.05 to 0.3 Hz and 3 m/s2 with 25 degrees of roll, the vehicle's of roads
BASES: dict[str, BaseSpectrum] = {
    "table": BaseSpectrum(),
    "cart": BaseSpectrum(slow_acceleration=1.0, slowest_hz=0.2, fastest_hz=0.5, push=2.0),
    "vehicle": BaseSpectrum(
        acceleration=8.0, slow_acceleration=4.0, slowest_hz=0.1, fastest_hz=0.5, turning=2.5, push=5.0
    ),
    "ship": BaseSpectrum(
        slow_acceleration=3.0, slowest_hz=0.05, fastest_hz=0.3, rocking_hz=0.3, turning=1.5, jolt=0.4, push=math.inf
    ),
}


def base_spectrum(base: str | BaseSpectrum) -> BaseSpectrum:
    """Return how a base of a name moves; a spectrum itself is returned as it is."""
    if isinstance(base, BaseSpectrum):
        return base
    if base not in BASES:
        raise InputError(f'mounted on "{base}": expected one of {", ".join(BASES)}')
    return BASES[base]
