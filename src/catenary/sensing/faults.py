"""Faults of a sensor of gravity by name, and what each means to a person."""

from enum import Flag, auto


class Fault(Flag):
    """Faults, which may come together."""

    NONE = 0
    NOTHING_RECEIVED = auto()
    INTERRUPTED = auto()
    RATES_INTERRUPTED = auto()
    SAMPLES_LOST = auto()
    NOT_FINITE = auto()
    STUCK = auto()
    SATURATED = auto()
    SPIKE = auto()
    JUMP = auto()
    WRONG_SIGN = auto()
    UPSIDE_DOWN = auto()
    AXES_SWAPPED = auto()
    UNIT_G = auto()
    UNIT_CM = auto()
    GRAVITY_STRIPPED = auto()
    MAGNITUDE = auto()
    STAMP_BACKWARDS = auto()
    STAMP_REPEATED = auto()
    STAMP_FUTURE = auto()
    STAMP_OLD = auto()
    RATE_NOT_FINITE = auto()
    RATE_STUCK = auto()
    RATE_SATURATED = auto()
    RATE_SPIKE = auto()
    RATE_TOO_FAST = auto()
    RATE_CONTRADICTS = auto()
    DISAGREEMENT = auto()

    @property
    def message(self) -> str:
        """What it means and what to do about it; a sentence for each of several faults."""
        return "; ".join(_MESSAGES[fault] for fault in self)

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each, in lower case."""
        return tuple(str(fault.name).lower() for fault in self)


_MESSAGES = {
    Fault.NOTHING_RECEIVED: "no sample was received: gravity is that of a level base; is the sensor plugged in?",
    Fault.INTERRUPTED: "samples stopped coming: gravity is held, then falls back; check cable and driver",
    Fault.RATES_INTERRUPTED: "no angular rates come: the turning of the base is not compensated for",
    Fault.SAMPLES_LOST: "samples came faster than they were taken, and the oldest were lost",
    Fault.NOT_FINITE: "the accelerometer gave NaN, infinity or numbers beyond any sensor",
    Fault.STUCK: "the accelerometer repeats one reading bit for bit: it has stopped measuring",
    Fault.SATURATED: "the accelerometer is at the end of its range: choose a larger one, or damp the base",
    Fault.SPIKE: "single readings far from those before and after: loose wiring, or knocks on the base",
    Fault.JUMP: "gravity changed at once by more than a base can turn, and stayed there: did the sensor come loose?",
    Fault.WRONG_SIGN: "gravity turned into its opposite: at rest specific force points up, free-fall acceleration down",
    Fault.UPSIDE_DOWN: "the base seems to hang upside down: specific force and free-fall acceleration mixed up? "
    "If it does hang so, raise max_tilt",
    Fault.AXES_SWAPPED: "gravity is right but for the order or signs of its axes: another driver or setting?",
    Fault.UNIT_G: "readings are of length 1 at rest: they seem to be in g, not m/s2",
    Fault.UNIT_CM: "readings are of length 1000 at rest: they seem to be in cm/s2 or milli-g, not m/s2",
    Fault.GRAVITY_STRIPPED: "readings are near 0: the driver takes gravity away; ask it for raw acceleration",
    Fault.MAGNITUDE: "readings are not of gravity's length, at rest or in the mean: calibrate with a tumble, or "
    "does the base move by itself (mounted on a vehicle, a ship)?",
    Fault.STAMP_BACKWARDS: "a time stamp went back",
    Fault.STAMP_REPEATED: "a time stamp was repeated",
    Fault.STAMP_FUTURE: "a time stamp lies in the future: the clocks differ",
    Fault.STAMP_OLD: "samples were too old when they came: the clocks differ, or something queues them",
    Fault.RATE_NOT_FINITE: "the gyroscope gave NaN, infinity or numbers beyond any sensor",
    Fault.RATE_STUCK: "the gyroscope repeats one reading bit for bit: it has stopped measuring",
    Fault.RATE_SATURATED: "the gyroscope is at the end of its range: choose a larger one, or rad/s are deg/s",
    Fault.RATE_SPIKE: "single angular rates far from those before and after",
    Fault.RATE_TOO_FAST: "angular rates are faster than a base turns: deg/s for rad/s?",
    Fault.RATE_CONTRADICTS: "the gyroscope says that the base turns while gravity stands still: "
    "bias, or deg/s for rad/s",
    Fault.DISAGREEMENT: "the accelerometer says that the base tips, the gyroscope that it stands still: neither is "
    "believed until they agree; is the gyroscope dead, or is the base pushed hard (max_push)?",
}
