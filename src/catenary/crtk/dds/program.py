"""This program's part of a DDS domain: one node of ROS 2, its readers and writers, and the thread that receives.

One thread waits for whatever comes, and nothing of DDS's calls into Python: Cyclone's listeners would wait for Python's
lock with locks of their own held, which its Python's `write` waits for while it holds Python's.

The same thread lets go of what was ended. DDS deletes a reader, a writer or the participant in its `__del__`, which
takes a while, and what is raised in `__del__` Python ignores: in the main thread a Ctrl-C that came then would be lost.

Which domain, and who is heard there, ROS 2's environment variables say: ROS_DOMAIN_ID (0);
ROS_AUTOMATIC_DISCOVERY_RANGE (SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT), ROS_STATIC_PEERS, and ROS_LOCALHOST_ONLY of
distributions up to Humble. What CYCLONEDDS_URI says comes last and overrules, as with rmw_cyclonedds.
"""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from cyclonedds.core import DDSException, DDSStatus, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from catenary.crtk.dds.directory import HANDLES, MANY, Directory, Endpoint, Quality, discovery_types, presence, profile
from catenary.crtk.dds.types import DISCOVERY, Distribution
from catenary.errors import InputError, TransportError

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
LARGEST = 232  # number of a domain, by the ports that DDS makes of it
_MOST_PROGRAMS = 120  # on one machine that find each other without multicast
_FAST_DDS = "1.15"  # its vendor's number; from version 3 on (Kilted) both disagree on what is said of types
_MOST_BYTES = 2**26  # of a message from the network
_logger = logging.getLogger(__name__)
_domains: dict[int, Domain | None] = {}  # a process has each once, until it ends; None: somebody else's in it
_lock = threading.Lock()


def domain_number() -> int:
    """Return the domain's number, ROS_DOMAIN_ID."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (text.isascii() and text.isdigit() and int(text) <= LARGEST):
        raise InputError(f'ROS_DOMAIN_ID "{text}": expected a whole number from 0 to {LARGEST}')
    return int(text)


def enter_domain() -> int:
    """Set up the domain of this process, where that has not been done; return its number."""
    number = domain_number()
    settings = ",".join(part for part in (_settings(), os.environ.get("CYCLONEDDS_URI", "")) if part)
    with _lock:
        if number not in _domains:
            try:
                _domains[number] = Domain(number, settings)
            except (DDSException, UnicodeError) as error:
                if getattr(error, "code", None) == DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                    _domains[number] = None  # set up before by another part of this program
                    return number
                raise TransportError(
                    f"DDS domain {number} (ROS_DOMAIN_ID) cannot be entered: {error} CYCLONEDDS_URI is "
                    f'"{os.environ.get("CYCLONEDDS_URI", "")}"'
                ) from error
    return number


def _settings() -> str:
    """Return Cyclone DDS's settings for whom to hear."""
    wide = _range()
    peers = [] if wide in ("OFF", "SYSTEM_DEFAULT") else _peers()
    if wide == "LOCALHOST":
        peers.insert(0, "localhost")
    found = f"<Internal><MaxSampleSize>{_MOST_BYTES} B</MaxSampleSize></Internal>"
    found += f"<Compatibility><IgnoreTypeInformation>{_FAST_DDS}</IgnoreTypeInformation></Compatibility>"
    if wide in ("LOCALHOST", "OFF"):
        found += "<General><AllowMulticast>false</AllowMulticast></General>"
    if wide == "OFF":
        tag = f"<Tag>ros_discovery_off_{os.getpid()}</Tag>"  # nobody else has this one
        found += f"<Discovery><ParticipantIndex>none</ParticipantIndex>{tag}</Discovery>"
    elif wide != "SYSTEM_DEFAULT":
        places = "".join(f'<Peer address="{peer}"/>' for peer in peers)
        found += (
            f"<Discovery><ParticipantIndex>auto</ParticipantIndex>"
            f"<MaxAutoParticipantIndex>{_MOST_PROGRAMS}</MaxAutoParticipantIndex>"
            f"{f'<Peers>{places}</Peers>' if places else ''}</Discovery>"
        )
    return f"<CycloneDDS><Domain>{found}</Domain></CycloneDDS>"


def _range() -> str:
    """Return how far programs are looked for; ROS_LOCALHOST_ONLY goes before, as in ROS 2."""
    if os.environ.get("ROS_LOCALHOST_ONLY", "") == "1":
        return "LOCALHOST"
    wide = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    if wide not in RANGES:
        raise InputError(f'ROS_AUTOMATIC_DISCOVERY_RANGE "{wide}": expected one of {", ".join(RANGES)}')
    return wide


def _peers() -> list[str]:
    """Return the addresses that ROS_STATIC_PEERS lists."""
    found = [peer.strip() for peer in os.environ.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    for peer in found:
        if any(character in "<>&\"'" or character.isspace() for character in peer):
            raise InputError(f'ROS_STATIC_PEERS: "{peer}": expected addresses, with semicolons between them')
    return found


_LOOK = 100_000_000  # [ns] between looks where nothing comes
_LEFT = 0.02  # [s] after which nobody else refers to what was ended
Came = Callable[[Endpoint], None]


class Program:
    """A participant of DDS with one node; `lock` is held while anything is received, made or ended."""

    def __init__(self, node: str, namespace: str, distribution: Distribution, came: Came) -> None:
        """Join the domain; `came` hears of each end of a topic that comes, with the lock held."""
        self.lock = threading.RLock()
        self.distribution, self._namespace, self._node = distribution, namespace, node
        self.node = f"{namespace.rstrip('/')}/{node}"  # its full name
        self._came = came
        self._takers: dict[int, Callable[[], None]] = {}
        self._stopped = False
        try:
            self._participant = DomainParticipant(enter_domain(), Qos(Policy.Userdata(b"enclave=/;")))
            self.gid: bytes = self._participant.guid.bytes
            topic = Topic(self._participant, DISCOVERY, discovery_types(distribution.gid)[-1])
            self._presence = DataWriter(self._participant, topic, profile(Quality(is_latched=True), 1))
            # more than one of them is kept, since programs are not told apart
            told = DataReader(self._participant, topic, profile(Quality(is_latched=True), MANY))
            self.directory = Directory(self._participant, told, (self.gid, self.node))
            self._waitset = WaitSet(self._participant)
        except DDSException as error:
            raise TransportError(f"DDS: {error}") from error
        for reader in self.directory.readers:
            self._waitset.attach(reader)
        self._ends: dict[Any, bytes] = {}  # readers and writers, and their numbers
        self._ended: list[tuple[float, Any]] = []  # when to let go [s], and of which reader or writer
        self._is_told = False  # of the ends, to other programs
        self._thread = threading.Thread(target=self._receive, name=f"{node} receiver", daemon=True)
        self._thread.start()

    def writer(self, dds_name: str, kind: Any, quality: Quality, depth: int, user_data: str) -> DataWriter[Any]:
        """Begin to publish; `end` ends it."""
        with self.lock:
            made = DataWriter(self._participant, self._topic(dds_name, kind), profile(quality, depth, user_data))
            self._begin(made)
        return made

    def reader(
        self, dds_name: str, kind: Any, quality: Quality, depth: int, user_data: str, taker: Callable[[Any], None]
    ) -> DataReader[Any]:
        """Begin to receive: `taker` takes from the reader, in the receiver's thread; `end` ends it."""
        with self.lock:
            made = DataReader(self._participant, self._topic(dds_name, kind), profile(quality, depth, user_data))
            made.set_status_mask(DDSStatus.DataAvailable)
            self._takers[id(made)] = lambda: taker(made)
            self._waitset.attach(made)
            self._begin(made)
        return made

    def _begin(self, made: Any) -> None:
        self._ends[made] = made.guid.bytes
        self._tell()

    def end(self, reader_or_writer: Any) -> None:
        """End a reader or a writer, which DDS does when nobody refers to it any more; the caller then must not."""
        with self.lock:
            if self._ends.pop(reader_or_writer, None) is None:
                return
            self._ended.append((time.monotonic() + _LEFT, reader_or_writer))
            if self._takers.pop(id(reader_or_writer), None) is not None:
                self._waitset.detach(reader_or_writer)
            self._tell()

    def look(self) -> None:
        """Take in who is there, and all that has come."""
        with self.lock:
            if self._stopped:
                return
            for end in self.directory.refresh():
                self._came(end)
            for take in tuple(self._takers.values()):
                take()
            if not self._is_told:
                self._is_told = True
                ends: tuple[list[bytes], list[bytes]] = ([], [])
                for one, gid in self._ends.items():
                    ends[isinstance(one, DataWriter)].append(gid)
                self._presence.write(presence(self.distribution.gid, self.gid, self._namespace, self._node, *ends))

    def ends(self, known: Mapping[int, Endpoint], handles: Iterable[int]) -> list[Endpoint]:
        """Return what Cyclone calls by these handles; it is looked up anew only where one is not known yet."""
        found = [handle % HANDLES for handle in handles]
        if not known.keys() >= set(found):
            self.look()
        return [known[handle] for handle in found if handle in known]

    def close(self) -> None:
        """Leave the domain."""
        with self.lock:
            if self._stopped:
                return
            self._stopped = True
            self._waitset.set_trigger(True)
        self._thread.join()

    def _leave(self) -> None:
        """Let go of everything, in the receiver's thread."""
        for reader in (*self.directory.readers, *(one for one in self._ends if id(one) in self._takers)):
            self._waitset.detach(reader)
        self._ends.clear()
        self._takers.clear()
        self._ended.clear()
        del self._waitset, self._presence, self.directory, self._participant

    def _topic(self, dds_name: str, kind: Any) -> Topic[Any]:
        try:
            return Topic(self._participant, dds_name, kind)
        except DDSException as error:
            raise TransportError(f"DDS topic {dds_name}: {error}") from error

    def _tell(self) -> None:
        self._is_told = False
        self._waitset.set_trigger(True)

    def _receive(self) -> None:
        while not self._stopped:
            self._waitset.wait(round(_LEFT * 1e9) if self._ended else _LOOK)
            self._waitset.set_trigger(False)
            try:
                self.look()
            except Exception:  # one message, or one program, must not end it
                _logger.exception("receiver of %s", self._node)
            self._let_go()
        self._leave()

    def _let_go(self) -> None:
        """Let DDS delete what was ended, in this thread."""
        with self.lock:
            now = time.monotonic()
            over = [one for at, one in self._ended if at <= now]
            self._ended = [pair for pair in self._ended if pair[0] > now]
        over.clear()
