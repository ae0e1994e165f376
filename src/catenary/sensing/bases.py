"""What a sensor stands on, and the rules and filters that suit it: a table, a cart, a vehicle, a ship."""

import math
from dataclasses import dataclass, replace

from catenary.errors import InputError
from catenary.sensing.checks import SensorRules
from catenary.sensing.delay_free_filter import CUTOFF_BY_WINDOW
from catenary.spatial import STANDARD_GRAVITY

# [m/s2] of a reading: 400 ug/sqrt(Hz) at 200 Hz, MPU-6050 specification rev. 3.4, table 6.2
CHEAP_NOISE = 0.04
UNCALIBRATED = 0.8  # [m/s2] by which a cheap sensor's length is off: 80 mg on its z axis, the same table
LEFT = 0.5  # [m/s2] of slow accelerations that may be left in the mean
SURE = 5.0  # standard deviations within which noise stays, of one axis
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
    if isinstance(base, str) and base not in BASES:
        raise InputError(f'mounted on "{base}": expected one of {", ".join(BASES)}')
    return BASES[base] if isinstance(base, str) else base


def rules_for(
    base: str | BaseSpectrum, *, noise: float = CHEAP_NOISE, changes: dict[str, float] | None = None
) -> SensorRules:
    """Return the rules that suit a base and a sensor.

    With s the noise of a reading: a step may be the base's jolt and 5 s; readings at rest spread by 4 s on each of
    three axes, 0.3 m/s2 at least; slow accelerations a of frequencies from f on average out over `mean_time` T to
    3 a / (2 pi f T) at most, for which T is chosen; lengths in the mean are then gravity's, give or take what is left
    and what a sensor that nobody calibrated is off by. For a table and a cheap sensor these are the defaults of
    SensorRules. Noise is the standard deviation of an axis of a reading at rest [m/s2]; `changes` are fields of
    SensorRules that are to be others.
    """
    if not 0.0 <= noise < math.inf:
        raise InputError(f"sensor noise: expected 0 or more m/s2, got {noise}")
    spectrum = base_spectrum(base)
    slow = spectrum.slow_acceleration
    mean_time = max(1.0, 3.0 * slow / (2.0 * math.pi * spectrum.slowest_hz * LEFT))
    left = UNCALIBRATED + (LEFT if slow > 0.0 else 0.0)
    rules = SensorRules(
        max_step=round(spectrum.jolt + SURE * noise, 3),
        max_rate=spectrum.turning,
        max_acceleration=spectrum.acceleration,
        rest_lower=round(STANDARD_GRAVITY - left, 1),
        rest_upper=round(STANDARD_GRAVITY + left, 1),
        rest_spread=round(max(0.3, 4.0 * math.sqrt(3.0) * noise), 3),
        mean_time=round(mean_time, 1),
        slow_acceleration=slow,
        slow_jerk=round(2.0 * math.pi * spectrum.fastest_hz * slow, 2),
        max_push=spectrum.push,
    )
    unknown = sorted(set(changes or ()) - set(vars(rules)))
    if unknown:
        raise InputError(f"sensor rules: no rule {', '.join(unknown)}; there are {', '.join(vars(rules))}")
    return replace(rules, **(changes or {}))  # type: ignore[arg-type]  # confirm and stuck_samples count
