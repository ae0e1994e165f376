"""Pose of a frame in another one that is fixed relative to it, from /tf_static and /tf, live or recorded."""

from itertools import islice
from pathlib import Path

import numpy as np

from catenary.crtk.message import CDR, ROS1, Message, codec
from catenary.crtk.message_values import pose_of
from catenary.crtk.transport import Transport
from catenary.errors import InputError
from catenary.recording.bag_reader import open_recording
from catenary.spatial import Pose, identity_pose
from catenary.topics import SECOND

_TOPICS, _TYPE = ("/tf_static", "/tf"), "tf2_msgs/TFMessage"
_WAIT_S = 3.0  # [s] for transforms that are published now and then
_MESSAGES = 5000  # messages of a recording that are looked at: static transforms were sent by then
_MOVED_BY = 1e-3  # [m, or of a rotation matrix] by which a frame moves against its parent


class TransformTree:
    """Frames with their parents, as messages tell them."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Pose]] = {}
        self._moving: set[str] = set()

    def add(self, message: Message) -> None:
        """Take a tf2_msgs/TFMessage."""
        for one in message.transforms:
            child, parent, pose = one.child_frame_id.lstrip("/"), one.header.frame_id.lstrip("/"), pose_of(one)
            _, before = self._parents.get(child, (parent, pose))
            if max(np.abs(a - b).max() for a, b in zip(pose, before, strict=True)) > _MOVED_BY:
                self._moving.add(child)
            self._parents[child] = parent, pose

    def pose(self, base: str, frame: str) -> Pose:
        """Return the pose of a frame in a base; refuse those to which no transforms lead, or that move."""
        up, down = self._to_root(base), self._to_root(frame)
        if list(up)[-1] != list(down)[-1]:
            known = sorted({*self._parents, *(parent for parent, _ in self._parents.values())})
            raise InputError(f'tf: nothing leads from "{base}" to "{frame}"; frames: {", ".join(known) or "none"}')
        moving = sorted(self._moving & (set(up) ^ set(down)))
        if moving:
            raise InputError(f'tf: "{frame}" moves against "{base}", at {", ".join(moving)}; expected one fixed to it')
        return up[list(up)[-1]].inverse() @ down[list(down)[-1]]

    def _to_root(self, name: str) -> dict[str, Pose]:
        """Return the pose of a frame in itself, its parent and so on; the root comes last."""
        poses = {name: identity_pose()}
        while name in self._parents and self._parents[name][0] not in poses:
            parent, pose = self._parents[name]
            poses[parent] = pose @ poses[name]
            name = parent
        return poses


def recorded_pose(path: Path, base: str, frame: str) -> Pose:
    """Return the pose of a frame in a base by the transforms of a recording.

    Args:
        base, frame: Names of the frames.
    """
    source, tree = open_recording(path), TransformTree()
    there = [topic for topic in _TOPICS if topic in source.counts]
    decode = codec(_TYPE, ROS1 if source.encoding == "ros1" else CDR).decode
    for topic in there:
        for _, _, data in islice(source.messages({topic}), _MESSAGES):
            tree.add(decode(data))
    return tree.pose(base, frame)


def heard_pose(transport: Transport, base: str, frame: str) -> Pose:
    """Return the pose of a frame in a base by transforms published within three seconds; else TransportError.

    Args:
        base, frame: Names of the frames.
    """
    tree, subscriptions = TransformTree(), [transport.subscribe(topic, _TYPE) for topic in _TOPICS]
    end = transport.steady() + _WAIT_S * SECOND
    try:
        while True:
            for subscription in subscriptions:
                for message, _ in subscription.take():
                    tree.add(message)
            try:
                return tree.pose(base, frame)
            except InputError:
                if transport.steady() > end:
                    raise
            transport.sleep(0.05)
    finally:
        for subscription in subscriptions:
            subscription.close()
