"""Joints and recorded topics of a da Vinci PSM under the dVRK."""

import re
from collections.abc import Mapping

from catenary.errors import InputError
from catenary.topics import Topic, joint_topic

PSM = "dvrk_psm"  # of the catalogue, in the joints of measured_js
PSM_JOINTS = ("outer_yaw", "outer_pitch", "outer_insertion", "outer_roll", "outer_wrist_pitch", "outer_wrist_yaw")
# topics below its namespace: name of the columns, rate [Hz]; the last is a tracker's, which no dVRK has
_PSM_TOPICS: Mapping[str, tuple[str, float]] = {
    "measured_js": ("measured_js", 30.0),
    "setpoint_js": ("setpoint_js", 30.0),
    "tracker/measured_js": ("ext_jpos", 100.0),
}
_NAME = re.compile(rf"/?(?P<place>(?:\w+/)*PSM\w*)/(?P<verb>{'|'.join(_PSM_TOPICS)})")


def psm_topic(namespace: str, verb: str, rate: float | None = None) -> Topic:
    """Return a topic of a PSM as it is recorded.

    Args:
        namespace: Name of the arm, whose last word begins with PSM: "/PSM1".
        verb: One of `_PSM_TOPICS`.
        rate: Messages per second [Hz]; the dVRK's usual rate when None.
    """
    column, usual = _PSM_TOPICS[verb]
    name = f"/{namespace.strip('/')}/{verb}"
    if _NAME.fullmatch(name) is None:
        raise InputError(f'namespace "{namespace}": expected one whose last word begins with PSM, as /PSM1')
    bag = f"record_psm_{'tracker' if column == 'ext_jpos' else column}"
    return joint_topic(name, column, PSM_JOINTS, rate=rate or usual, bag=bag)


def psm_topics(namespace: str, *, state_rate: float = 30.0) -> tuple[Topic, ...]:
    """Return the topics of a calibration recording of a PSM.

    Args:
        namespace: Name of the arm: "/PSM1".
        state_rate: Rate of the arm's own topics [Hz]; a tracker's is its usual one.
    """
    return tuple(psm_topic(namespace, verb, None if verb.startswith("tracker") else state_rate) for verb in _PSM_TOPICS)


def psm_topic_named(name: str) -> Topic | None:
    """Return the topic of a PSM by how its name ends; None of another robot."""
    match = _NAME.fullmatch(name)
    return None if match is None else psm_topic(f"/{match['place']}", match["verb"])
