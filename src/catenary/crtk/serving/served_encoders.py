"""The external encoders of a served arm, as the group's rig publishes them: counts, and positions once registered.

They are no part of the RAVEN-II: a program of their own publishes them, 100 times a second.
"""

from collections.abc import Sequence

import numpy as np

from catenary.crtk.clock import SECOND
from catenary.crtk.conversions import joint_state_message
from catenary.crtk.names import JOINT_STATE, CrtkTopic
from catenary.crtk.serving.outlet import Outlet
from catenary.crtk.transport import Transport
from catenary.plant import Plant
from catenary.recording.topics import EXT_JPOS, JOINT_ENC, Topic

OF_RAVEN = (JOINT_ENC, EXT_JPOS)


def has_encoders(plant: Plant, topics: Sequence[Topic] = OF_RAVEN) -> bool:
    """Return whether a plant's telemetry holds what external encoders read, as topics carry it."""
    return {topic.columns[0].name for topic in topics} <= {c.name for c in plant.columns}


class ServedEncoders:
    """Publishes `joint_enc`, and `ext_jpos` [rad, rad, m] while it is known: no zero stands for what is not.

    Or, in place of a RAVEN-II's encoders, what a tracker sees of another arm's joints.
    """

    def __init__(self, transport: Transport, plant: Plant, topics: Sequence[Topic] = OF_RAVEN) -> None:
        """Begin to publish what a plant's telemetry holds, over topics."""
        self._plant = plant
        self.outlets = tuple(
            Outlet(transport, CrtkTopic(topic.name, JOINT_STATE, "out", topic.columns[0].name))
            for topic in topics
        )
        self._joints = topics[0].joint_names
        self._every = min(round(SECOND / topic.rate) for topic in topics)  # [ns]
        self._due: int | None = None

    def publish(self, now: int, stamp: int) -> None:
        """Publish at `now` [ns], stamped so [ns], if it is time and anybody listens."""
        if self._due is not None and 0 <= self._due - now < self._every:
            return
        # on a grid, so that ticks that come late do not make it slower; never two to catch up
        late = now - self._due if self._due is not None else 0
        self._due = now + self._every - (late if 0 <= late < self._every else 0)
        if not any(outlet.heard for outlet in self.outlets):
            return
        telemetry = self._plant.telemetry()
        for outlet in self.outlets:
            values = telemetry[outlet.topic.verb]
            if outlet.heard and np.isfinite(values).all():
                outlet.publish(joint_state_message(self._joints, stamp, values))
