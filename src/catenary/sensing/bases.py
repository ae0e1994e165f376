"""What a robot's base is mounted on, by name: how hard and how fast each moves by itself."""

import math
from dataclasses import dataclass

from catenary.errors import InputError


@dataclass(frozen=True)
class BaseSpectrum:
    """How a base moves by itself: what is usual there, by which a sensor is judged sooner or later."""

    slow_acceleration: float = 0.0  # [m/s2] what lasts for seconds: heave, surge, braking; 0 for none
    slowest_hz: float = 1.0  # lowest frequency of slow accelerations
    fastest_hz: float = 1.0  # their highest
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
    def mean_time(self) -> float:
        """Time over which slow accelerations average out to 0.5 m/s2 [s]: 3 a / (2 pi f 0.5 m/s2)."""
        return max(1.0, 3.0 * self.slow_acceleration / (math.pi * self.slowest_hz))

    @property
    def slow_jerk(self) -> float:
        """How fast slow accelerations change [m/s3]."""
        return 2.0 * math.pi * self.fastest_hz * self.slow_acceleration


# ours; the ship's are those of seas of 0.05 to 0.3 Hz and 3 m/s2, the vehicle's of roads
BASES: dict[str, BaseSpectrum] = {
    "table": BaseSpectrum(),
    "cart": BaseSpectrum(slow_acceleration=1.0, slowest_hz=0.2, fastest_hz=0.5, push=2.0),
    "vehicle": BaseSpectrum(slow_acceleration=4.0, slowest_hz=0.1, fastest_hz=0.5, push=5.0),
    "ship": BaseSpectrum(slow_acceleration=3.0, slowest_hz=0.05, fastest_hz=0.3, jolt=0.4, push=math.inf),
}


def base_spectrum(base: str | BaseSpectrum) -> BaseSpectrum:
    """Return how a base of a name moves; a spectrum itself is returned as it is."""
    if isinstance(base, BaseSpectrum):
        return base
    if not isinstance(base, str) or base not in BASES:
        raise InputError(f'mounted on "{base}": expected one of {", ".join(BASES)}')
    return BASES[base]
