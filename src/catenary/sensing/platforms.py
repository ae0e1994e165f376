"""Platforms that carry a robot's base (table, cart, vehicle, ship): spectra of their own accelerations."""

import math
from dataclasses import dataclass

from catenary.errors import InputError


@dataclass(frozen=True)
class BaseSpectrum:
    """Accelerations that a platform makes in normal use; they set the thresholds of fault detection."""

    slow_acceleration: float = 0.0  # [m/s2] amplitude of heave, surge and braking that last for seconds; 0 for none
    slowest_hz: float = 1.0  # lowest frequency of slow accelerations
    fastest_hz: float = 1.0  # their highest
    jolt: float = 1.0  # [m/s2] largest change of acceleration between two samples
    push: float = 1.4  # [m/s2] largest across gravity while the base does not turn; inf: not used to detect faults

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
        """Averaging time of the direction that fallback `fade` converges to [s]: a period of the slowest motion."""
        return 2.0 if self.slow_acceleration == 0.0 else max(2.0, 1.0 / self.slowest_hz)

    @property
    def mean_time(self) -> float:
        """Time over which slow accelerations average out to 0.5 m/s2 [s]: 3 a / (2 pi f 0.5 m/s2)."""
        return max(1.0, 3.0 * self.slow_acceleration / (math.pi * self.slowest_hz))

    @property
    def slow_jerk(self) -> float:
        """Largest rate of change of slow accelerations [m/s3]."""
        return 2.0 * math.pi * self.fastest_hz * self.slow_acceleration


# ours; the ship's are those of seas of 0.05 to 0.3 Hz and 3 m/s2, the vehicle's of roads
BASES: dict[str, BaseSpectrum] = {
    "table": BaseSpectrum(),
    "cart": BaseSpectrum(slow_acceleration=1.0, slowest_hz=0.2, fastest_hz=0.5, push=2.0),
    "vehicle": BaseSpectrum(slow_acceleration=4.0, slowest_hz=0.1, fastest_hz=0.5, push=5.0),
    "ship": BaseSpectrum(slow_acceleration=3.0, slowest_hz=0.05, fastest_hz=0.3, jolt=0.4, push=math.inf),
}


def base_spectrum(base: str | BaseSpectrum) -> BaseSpectrum:
    """Return the spectrum of a platform by its name; a spectrum is returned unchanged."""
    if isinstance(base, BaseSpectrum):
        return base
    if not isinstance(base, str) or base not in BASES:
        raise InputError(f'mounted on "{base}": expected one of {", ".join(BASES)}')
    return BASES[base]
