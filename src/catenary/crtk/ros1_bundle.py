"""Frames of many topics into the sockets of all their peers, by one compiled loop over the C library's `send`.

From Python, each topic and peer takes as long again as the kernel's part of sending does, and Python's lock is given
up and taken back as often. Here it is held throughout: sockets do not wait, and no other thread can close one, send
into it or connect another meanwhile. What a socket does not take at once, and every error, goes the ordinary way
(`Link.write_data`): nothing is lost that would not be lost there, and no frame is torn.

Imports rospy, by ros1_links.
"""

from collections.abc import Sequence

import numpy as np
import rospy

from catenary.crtk.bundle import Bundle
from catenary.crtk.frames import SEQ_AT
from catenary.crtk.ros1_links import Link, Publication, sender
from catenary.crtk.sheet import COUNT, HEARD, PLACE, SIZE, Bytes, Sheet, Whole
from catenary.kernels.compiled import compiled_quick, send_bytes

# columns of the table of links: topic, whether messages wait before the next one, bytes that the socket took of this
# tick's message, bytes and messages that it took since they were counted
_TOPIC, _WAITS, _TOOK, _BYTES, _MESSAGES = range(5)


class SocketBundle(Bundle):
    """Sends a sheet's frames to all peers, in the order of the topics."""

    def __init__(self, lent: Sequence[tuple[Publication, int]], sheet: Sheet) -> None:
        """Send a sheet's frames: each by a publication, which has sent some messages already."""
        self._publications = [publication for publication, _ in lent]
        self._sheet = sheet
        sheet.topics[:, COUNT] = [count for _, count in lent]
        self._latching = [k for k, publication in enumerate(self._publications) if publication.is_latch]
        self._sender = sender()
        self._seen: object = None
        self._table = np.empty((0, 5), dtype=np.int64)
        self._links: tuple[list[Link], Whole] = [], self._table  # with the table that counts what they sent
        self._sockets = np.empty(0, dtype=np.int64)
        for publication in self._publications:
            publication.settle = self._settle

    def send(self) -> None:
        """Send the frames that are marked as heard."""
        sheet = self._sheet
        if self._sender.changes is not self._seen:
            self._look()
        if send_frames(sheet.memory, sheet.topics, self._table, self._sockets):
            self._finish()
        for topic in self._latching:
            if sheet.topics[topic, HEARD]:
                self._publications[topic].latched = bytes(sheet.frame(topic))

    def _look(self) -> None:
        """Find out who is connected."""
        self._seen = self._sender.changes  # what changes from here on is looked at in the next tick
        self._settle()
        found: list[tuple[int, Link]] = []
        for topic, publication in enumerate(self._publications):
            lock = publication.publock
            if lock is None:
                continue  # it has ended
            with lock:  # one that is just coming gets the latched message first
                found += [(topic, link) for link in publication.connections]
        self._table = np.zeros((len(found), 5), dtype=np.int64)
        self._links = [link for _, link in found], self._table
        self._sockets = np.full(len(found), -1, dtype=np.int64)
        for k, (topic, link) in enumerate(found):
            self._table[k, _TOPIC], self._table[k, _WAITS] = topic, link.is_waiting
            link.lend_socket(self._sockets, k)

    def _finish(self) -> None:
        """Send the ordinary way what was not taken whole."""
        sheet, (links, _) = self._sheet, self._links
        for k, (topic, _, took, *_) in enumerate(self._table.tolist()):
            frame = sheet.frame(topic)
            if not sheet.topics[topic, HEARD] or took == len(frame):
                continue
            link = links[k]
            try:
                if took > 0:
                    link.keep(bytes(frame[took:]))
                else:
                    link.write_data(bytes(frame))
            except rospy.exceptions.TransportTerminated as error:
                self._publications[topic].end(link, error)
            self._table[k, _WAITS] = link.is_waiting

    def _settle(self) -> None:
        """Have counted what was sent; whoever asks rospy for its statistics may be another thread."""
        links, table = self._links
        sent = table[:, _BYTES:].copy()
        table[:, _BYTES:] -= sent
        for link, (size, messages) in zip(links, sent.tolist(), strict=True):
            link.count(size, messages)


@compiled_quick
def send_frames(memory: Bytes, topics: Whole, links: Whole, sockets: Whole) -> int:
    """Write every heard topic's seq and send its frame to all its peers.

    Args:
        memory: Where the frames lie.
        topics: (t, 4) of the sheet.
        links: (k, 5) as above.
        sockets: (k,) their numbers; -1 for one that is closed.

    Returns:
        Frames that were not taken whole.
    """
    begin = memory.ctypes.data
    for t in range(len(topics)):
        if topics[t, HEARD] != 0:
            topics[t, COUNT] += 1
            place = topics[t, PLACE] + SEQ_AT
            for k in range(4):
                memory[place + k] = (topics[t, COUNT] >> (8 * k)) & 255
    left = 0
    for k in range(len(links)):
        t = links[k, _TOPIC]
        if topics[t, HEARD] == 0:
            continue
        took = -1
        if sockets[k] >= 0 and links[k, _WAITS] == 0:
            took = send_bytes(sockets[k], begin + topics[t, PLACE], topics[t, SIZE])
        links[k, _TOOK] = took
        if took > 0:
            links[k, _BYTES] += took
        if took == topics[t, SIZE]:
            links[k, _MESSAGES] += 1
        else:
            left += 1
    return left
