"""Topics of the RAVEN-II: channels, units and their conversion to SI.

Source: uw-biorobotics/raven2 (local_io.cpp) and the set of topics that its group records. Pitfalls: every joint and
motor position and velocity in raven_state is multiplied by 180/pi, metres of insertion too; `pos` and `pos_d` are
integer micrometres; `tau` is the commanded torque at the gearbox's output before limits, not a measurement; `jac_f`
repeats `jac_vel`, in undocumented units. The arms' `measured_js` are swapped: arm1 is the green arm, arm2 the gold one.
`ravenstate_100hz` is published without a leading slash.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import UNUSED_CHANNEL, OperatingState
from catenary.topics import SECOND, Topic, TopicColumn, joint_topic
from catenary.units import TO_SI

Arm = Literal["gold", "green"]
ARM_OF_SIDE: Mapping[str, Arm] = {"left": "gold", "right": "green"}
ROBOT: Mapping[str, str] = {"gold": "raven2", "green": "raven2_right"}  # of the catalogue
JOINTS = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")  # of measured_js
UNITS = ("rad", "rad", "m", "rad", "rad", "rad", "rad")
AXES = (*JOINTS[:3], UNUSED_CHANNEL, *JOINTS[3:])  # of the eight channels of an arm in raven_state
# indices of an arm's joints among raven_state's 16 channels
CHANNELS: Mapping[str, tuple[int, ...]] = {"gold": (0, 1, 2, 4, 5, 6, 7), "green": (8, 9, 10, 12, 13, 14, 15)}
MEASURED_JS: Mapping[Arm, str] = {"gold": "/arm2/measured_js", "green": "/arm1/measured_js"}
# operating states of the run levels: emergency stop, init, pedal up, pedal down
RUN_LEVELS: Mapping[int, OperatingState] = {
    0: OperatingState("DISABLED", False, False),
    1: OperatingState("ENABLED", False, True),
    2: OperatingState("PAUSED", True, False),
    3: OperatingState("ENABLED", True, False),
}


def _state_columns() -> tuple[TopicColumn, ...]:
    def both(labels: Iterable[str]) -> tuple[str, ...]:
        labels = tuple(labels)
        return tuple(f"{arm}_{label}" for arm in CHANNELS for label in labels)

    single, arms, axes = ("",), tuple(CHANNELS), both(AXES)
    tip, matrix = both("xyz"), both(f"{row}{column}" for row in "123" for column in "123")
    six = both("123456")

    def whole(name: str, labels: tuple[str, ...], unit: str = "") -> TopicColumn:
        return TopicColumn(name, name, labels, (unit,) * len(labels), whole=True)

    def plain(name: str, labels: tuple[str, ...], unit: str = "", to_si: float = 1.0) -> TopicColumn:
        return TopicColumn(name, name, labels, (unit,) * len(labels), to_si)

    def axis(name: str, unit: str, insertion: str, to_si: float = TO_SI["deg"][1]) -> TopicColumn:
        units = ["" if one == UNUSED_CHANNEL else insertion if one == "insertion" else unit for one in AXES]
        return TopicColumn(name, name, axes, (*units, *units), to_si, required=name in ("jpos", "tau"))

    return (
        *(whole(name, single) for name in ("runlevel", "sublevel", "last_seq")),
        whole("type", arms),
        plain("pos", tip, "m", 1e-6),
        plain("ori", matrix),
        plain("ori_d", matrix),
        plain("pos_d", tip, "m", 1e-6),
        plain("dt", single, "s"),
        whole("encVals", axes, "count"),
        whole("dac_val", axes, "count"),
        axis("tau", "Nm", "Nm", to_si=1.0),
        axis("mpos", "rad", "rad"),
        axis("jpos", "rad", "m"),
        axis("mvel", "rad/s", "rad/s"),
        axis("jvel", "rad/s", "m/s"),
        axis("mpos_d", "rad", "rad"),
        axis("jpos_d", "rad", "m"),
        plain("grasp_d", arms),
        plain("encoffsets", axes, "count"),
        plain("jac_vel", six),
        plain("jac_f", six),
    )


RAVENSTATE = Topic("/ravenstate", "raven_2/raven_state", 30.0, _state_columns(), "record_ravenstate", "hdr")
RAVENSTATE_100HZ = replace(RAVENSTATE, name="ravenstate_100hz", rate=100.0)
STATE_COLUMNS: Mapping[str, TopicColumn] = {column.name: column for column in RAVENSTATE.columns}
_GOLD_MEASURED_JS = joint_topic(MEASURED_JS["gold"], "measured_js", JOINTS, rate=100.0, bag="record_CRTKmeasurejs")
_GREEN_MEASURED_JS = replace(_GOLD_MEASURED_JS, name=MEASURED_JS["green"])
EXT_JPOS = joint_topic("/ext_jpos", "ext_jpos", JOINTS[:3], rate=100.0, bag="record_ext_jenc")
JOINT_ENC = joint_topic(  # its type is not published; a JointState of counts is assumed
    "/joint_enc", "joint_enc", JOINTS[:3], rate=100.0, bag="record_joint_enc", unit="count"
)
RAVEN_TOPICS = (RAVENSTATE, RAVENSTATE_100HZ, _GOLD_MEASURED_JS, _GREEN_MEASURED_JS, EXT_JPOS, JOINT_ENC)


def raven_topics(arm: Arm = "gold", *, state_rate: float = 30.0) -> tuple[Topic, ...]:
    """Return the topics of a calibration recording of one arm.

    Args:
        arm: "gold" or "green".
        state_rate: Rate of /ravenstate [Hz], positive; 100 selects the topic ravenstate_100hz.
    """
    if not state_rate > 0.0:
        raise InputError(f"rate of /ravenstate: expected a positive number of Hz, got {state_rate}")
    is_fast = state_rate == RAVENSTATE_100HZ.rate
    state = RAVENSTATE_100HZ if is_fast else replace(RAVENSTATE, rate=state_rate)
    return (state, measured_topic(arm), EXT_JPOS, JOINT_ENC)


def measured_topic(arm: Arm) -> Topic:
    """Return the topic of an arm's measured_js."""
    return _GOLD_MEASURED_JS if arm == "gold" else _GREEN_MEASURED_JS


def state_column(message: object, name: str) -> Floats:
    """Return a field (width,) of a raven_state message in SI.

    Args:
        name: Field, one of STATE_COLUMNS.
    """
    values = np.atleast_1d(np.asarray(getattr(message, name), dtype=np.float64))
    return values / SECOND if name == "dt" else values * STATE_COLUMNS[name].to_si


def in_channels(arm: Arm, values: Floats) -> Floats:
    """Place values of an arm's joints in raven_state's channels (..., 16), zero in others.

    Args:
        arm, values: "gold" or "green", and (..., 7).
    """
    channels = np.zeros((*values.shape[:-1], 16))
    channels[..., CHANNELS[arm]] = values
    return channels


def further_columns(columns: Sequence[str], arm: Arm) -> dict[str, tuple[str, str]]:
    """Return message path and unit, by log signal, of further columns of raven_state; those in every log are left out.

    Args:
        columns: Names of STATE_COLUMNS, or "all".
        arm: Arm whose signals have no prefix: mpos:<axis> beside green_mpos:<axis> of the other arm.
    """
    unknown = [name for name in columns if name not in STATE_COLUMNS and name != "all"]
    if unknown:
        raise InputError(f"columns: no {', '.join(unknown)} in raven_state; it has all, {', '.join(STATE_COLUMNS)}")
    signals = {}
    for name in STATE_COLUMNS if "all" in columns else dict.fromkeys(columns):
        column = STATE_COLUMNS[name]
        for label, path, unit in zip(column.labels, column.paths, column.units, strict=True):
            if name in ("jpos", "tau") and label.startswith(arm):
                continue
            # the other arm's name is the prefix, so that its tau is not in the group tau
            whose, _, axis = label.partition("_")
            first = "" if whose in ("", arm) else f"{whose}_"
            signals[f"{first}{name}:{axis}" if axis else f"{first}{name}"] = path, unit
    return signals
