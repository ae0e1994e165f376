"""This program's part of a DDS domain: a node of ROS 2, its readers, writers and types, the thread that receives.

One thread waits for whatever comes, and nothing of DDS's calls into Python: Cyclone's listeners would wait for Python's
lock with locks of their own held, which its Python's `write` waits for while it holds Python's.

The same thread lets go of what was ended. DDS deletes a reader, a writer or the participant in its `__del__`, which
takes a while, and what is raised in `__del__` Python ignores: in the main thread a Ctrl-C that came then would be lost.

Which domain, and who is heard there, ROS 2's environment variables say: ROS_DOMAIN_ID (0);
ROS_AUTOMATIC_DISCOVERY_RANGE (SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT), ROS_STATIC_PEERS, and ROS_LOCALHOST_ONLY of
distributions up to Humble. What CYCLONEDDS_URI says comes last and overrules, as with rmw_cyclonedds.

Each program writes rmw_dds_common/ParticipantEntitiesInfo to DDS's topic `ros_discovery_info`: its own number, and for
each node its name and the numbers of its readers and writers (ROS 2 design 151). A number (Gid) is DDS's of 16 bytes,
followed by zeros up to 24 in distributions up to Humble.

Topic `/arm1/measured_js` is DDS's `rt/arm1/measured_js`; type sensor_msgs/msg/JointState is
`sensor_msgs::msg::dds_::JointState_`. (ROS 2's design, "Topic and Service name mapping to DDS".)

Types are made at run time from the descriptions that ROS 1's messages have too. What an instance carries is the
message's bytes (CDR), made and read elsewhere; DDS itself needs the fields to tell types apart and to refuse bytes that
are no message of the type.
"""

import logging
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType, new_class
from typing import Any, NamedTuple

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSException, DDSStatus, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from catenary.crtk.message import HEADER
from catenary.crtk.transport import UNNAMED_NODE
from catenary.errors import InputError, TransportError
from catenary.recording.messages import NUMBERS, Field, current_name, fields, ros2_name, typestore

DISCOVERY = "ros_discovery_info"  # where each program tells which nodes it has; no topic of ROS
_TYPE = re.compile(r"(\w+)::msg::dds_::(\w+)_")


def dds_topic(topic: str) -> str:
    """Return DDS's name of a topic."""
    return f"rt{topic}"


def ros_topic(name: str) -> str | None:
    """Return the topic that DDS calls so, or None if it is none of ROS."""
    return name[2:] if name.startswith("rt/") else None


def dds_type(name: str) -> str:
    """Return DDS's name of a message type, or of a field's."""
    package, _, message = current_name(name).partition("/")
    return f"{package}::msg::dds_::{message}_"


def ros_type(name: str) -> str:
    """Return the message type that DDS calls so; a name that is none of ROS's as it is."""
    match = _TYPE.fullmatch(name)
    return current_name(f"{match[1]}/{match[2]}") if match else name


class Distribution(NamedTuple):
    """A distribution of ROS 2, as its programs find each other."""

    gid: int  # bytes that identify a program or endpoint in ros_discovery_info
    has_hashes: bool  # topics' ends carry a hash of their type, which ROS 2 warns without

    def said_of(self, type_hash: str) -> str:
        """Return the user data of a topic's endpoint about its type."""
        return f"typehash={type_hash};" if self.has_hashes else ""


# rmw's storage of a gid had 24 bytes up to Humble; type hashes came with Iron (REP 2016)
_DISTRIBUTIONS: Mapping[str, Distribution] = MappingProxyType(
    {"humble": Distribution(24, False)} | dict.fromkeys(("iron", "jazzy", "kilted", "rolling"), Distribution(16, True))
)
_DEFAULT_DISTRIBUTION = "jazzy"  # the newest with support of five years


def distribution(name: str | None = None) -> Distribution:
    """Return a distribution: the one named, else ROS_DISTRO where ROS 2's setup was sourced, else jazzy."""
    if name is None:
        return _DISTRIBUTIONS.get(os.environ.get("ROS_DISTRO", ""), _DISTRIBUTIONS[_DEFAULT_DISTRIBUTION])
    if name not in _DISTRIBUTIONS:
        raise InputError(f'ROS 2 distribution "{name}": expected one of {", ".join(_DISTRIBUTIONS)}')
    return _DISTRIBUTIONS[name]


@cache
def message_hash(name: str) -> str:
    """Return ROS 2's hash of a message type (REP 2016), by which its programs tell versions of it apart."""
    return typestore(2).hash_rihs01(ros2_name(name))


_NUMBERS = {name: getattr(idl, name) for name in NUMBERS if name not in ("bool", "byte", "char")}
_NUMBERS |= {"bool": bool, "byte": idl.uint8, "char": idl.uint8}
_TIMES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
_EMPTY = {"structure_needs_at_least_one_member": idl.uint8}  # ROS 2's field of a type that has none
# their brackets make types, which their hints do not know
array: Any = idl.array
sequence: Any = idl.sequence
Raw = Any  # an instance: made of bytes, which are its `data`


@cache
def message_type(name: str) -> type[Raw]:
    """Return DDS's class of a message type."""
    return _raw(dds_type(name), _members(name))


def _members(name: str) -> dict[str, Any]:
    dropped = "seq" if name == HEADER else ""  # which ROS 2's has not
    return {field.name: _member(field) for field in fields(name) if field.name != dropped} or dict(_EMPTY)


def _member(field: Field) -> Any:
    if field.length is not None:
        single = _member(field._replace(length=None))
        return array[single, field.length] if field.length else sequence[single]
    if field.type in _NUMBERS:
        return _NUMBERS[field.type]
    if field.type in _TIMES:
        return _time(dds_type(_TIMES[field.type]))
    return str if field.type == "string" else message_type(field.type)


@cache
def _time(name: str) -> type[Raw]:
    return _raw(name, {"sec": idl.int32, "nanosec": idl.uint32})


def _raw(typename: str, members: dict[str, Any]) -> type[Raw]:
    """Return a class of DDS's, of these fields, whose instances are bytes."""

    def begin(self: Raw, data: bytes) -> None:
        self.data = data

    def body(namespace: dict[str, Any]) -> None:
        namespace["__annotations__"].update(members)
        namespace["__init__"] = begin
        namespace["serialize"] = lambda self, *_, **__: self.data
        namespace["deserialize"] = classmethod(lambda made, data, *_, **__: made(data))
        namespace["deserialize_key"] = classmethod(lambda made, *_, **__: made(b""))  # it has none

    return new_class(typename.rpartition("::")[2], (IdlStruct,), {"typename": typename}, body)


_RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_LAST_DOMAIN = 232  # number of a domain, by the ports that DDS makes of it
_PROGRAMS = 120  # on one machine that find each other without multicast
_SAID_EVERY = "1 s"  # that a program is there: to those that came later, and hear only what is sent to them
_FAST_DDS = "1.15"  # its vendor's number; from version 3 on (Kilted) both disagree on what is said of types
_MESSAGE_BYTES = 2**26  # of a message from the network
# [B] Linux keeps 208 KiB for a computer out of reach; where no more fits, a writer waits, up to 2 s
_UNSENT_BYTES = 2**20
_logger = logging.getLogger(__name__)
_domains: dict[int, Domain | None] = {}  # a process has each once, until it ends; None: somebody else's in it
_lock = threading.Lock()


def domain_number() -> int:
    """Return the domain's number, ROS_DOMAIN_ID."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (text.isascii() and text.isdigit() and int(text) <= _LAST_DOMAIN):
        raise InputError(f'ROS_DOMAIN_ID "{text}": expected a whole number from 0 to {_LAST_DOMAIN}')
    return int(text)


def enter_domain() -> int:
    """Set up the domain of this process, where that has not been done; return its number."""
    number = domain_number()
    uri, rmw = (os.environ.get(name, "") for name in ("CYCLONEDDS_URI", "RMW_IMPLEMENTATION"))
    if "zenoh" in rmw:
        _logger.warning("RMW_IMPLEMENTATION is %s, which does not use DDS: its programs are not received here", rmw)
    with _lock:
        error: Exception | None = None
        for interfaces in _interfaces(uri) if number not in _domains else ():
            try:
                _domains[number] = Domain(number, ",".join(part for part in (_settings(interfaces), uri) if part))
                return number
            except (DDSException, UnicodeError) as failure:
                if getattr(failure, "code", None) == DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                    _domains[number] = None  # set up before by another part of this program
                    return number
                error = failure
    if error is not None:
        raise TransportError(
            f'DDS domain {number} (ROS_DOMAIN_ID) cannot be entered: {error} CYCLONEDDS_URI is "{uri}"'
        ) from error
    return number


def _interfaces(uri: str) -> tuple[str, ...]:
    """Return settings of which interfaces to use, to be tried in turn; what a user `said`, in text or files, overrules.

    Loopback is named, last: else programs of this machine that keep to it are not seen when they come later.
    """
    files = re.findall(r"(?:^|,)\s*(?:file://)?([^<,\s][^,]*)", uri)
    read = (Path(place) for place in files if os.access(place, os.R_OK))
    texts = (uri, *(one.read_text(encoding="utf-8", errors="replace") for one in read if one.is_file()))
    if _range() == "SYSTEM_DEFAULT" or any("NetworkInterface" in text for text in texts):
        return ("",)
    routes = Path("/proc/net/route")
    lines = routes.read_text(encoding="utf-8").splitlines() if routes.is_file() else ["", "unknown"]
    is_offline = all(line.startswith("lo\t") for line in lines[1:])
    others = '<NetworkInterface autodetermine="true" priority="1"/>' if _reaches_others() and not is_offline else ""
    loopback = '<NetworkInterface address="127.0.0.1" priority="0" multicast="false"/>'
    return f"<Interfaces>{others}{loopback}</Interfaces>", ""


def _settings(interfaces: str) -> str:
    wide = _range()
    settings = f"<Internal><MaxSampleSize>{_MESSAGE_BYTES} B</MaxSampleSize>"
    settings += f'<SocketSendBufferSize max="{_UNSENT_BYTES} B"/></Internal>'
    settings += f"<Compatibility><IgnoreTypeInformation>{_FAST_DDS}</IgnoreTypeInformation></Compatibility>"
    multicast = "<AllowMulticast>false</AllowMulticast>" if wide in ("LOCALHOST", "OFF") else ""
    settings += f"<General>{interfaces}{multicast}</General>"
    if wide == "OFF":
        tag = f"<Tag>ros_discovery_off_{os.getpid()}</Tag>"  # nobody else has this one
        settings += f"<Discovery><ParticipantIndex>none</ParticipantIndex>{tag}</Discovery>"
    elif wide != "SYSTEM_DEFAULT":
        peers = [*(["localhost"] if wide == "LOCALHOST" else []), *_peers()]
        places = "".join(f'<Peer address="{peer}"/>' for peer in peers)
        # Cyclone complains of each time that a static peer is not reached
        often = "" if _peers() else f"<SPDPInterval>{_SAID_EVERY}</SPDPInterval>"
        settings += (
            f"<Discovery><ParticipantIndex>auto</ParticipantIndex>"
            f"<MaxAutoParticipantIndex>{_PROGRAMS}</MaxAutoParticipantIndex>{often}"
            f"{f'<Peers>{places}</Peers>' if places else ''}</Discovery>"
        )
    return f"<CycloneDDS><Domain>{settings}</Domain></CycloneDDS>"


def _reaches_others() -> bool:
    return _range() == "SUBNET" or (_range() == "LOCALHOST" and bool(_peers()))


def _range() -> str:
    """Return the discovery range; ROS_LOCALHOST_ONLY takes precedence, as in ROS 2."""
    if os.environ.get("ROS_LOCALHOST_ONLY", "") == "1":
        return "LOCALHOST"
    wide = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    if wide not in _RANGES:
        raise InputError(f'ROS_AUTOMATIC_DISCOVERY_RANGE "{wide}": expected one of {", ".join(_RANGES)}')
    return wide


def _peers() -> list[str]:
    peers = [peer.strip() for peer in os.environ.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    for peer in peers:
        if any(character in "<>&\"'" or character.isspace() for character in peer):
            raise InputError(f'ROS_STATIC_PEERS: "{peer}": expected addresses, with semicolons between them')
    return peers


_NO_WAIT_NS = 0  # [ns] that a publisher waits for its readers


class Quality(NamedTuple):
    """What peers have to agree on; a reader gets nothing of a writer that offers less than it asks for."""

    is_reliable: bool = True  # lost messages are sent again; else best effort, as of sensors
    is_latched: bool = False  # transient local: whoever comes later gets the last message; else volatile


def profile(quality: Quality, depth: int, user_data: str = "") -> Qos:
    """Return the policies of a reader or writer that keeps `depth` messages."""
    policies = [
        Policy.Reliability.Reliable(_NO_WAIT_NS) if quality.is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if quality.is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.WriterDataLifecycle(autodispose=False),  # the end of a writer is no message
    ]
    if quality.is_latched:
        # who comes later gets the last one, however many are kept for readers that are slow
        policies.append(Policy.DurabilityService(0, Policy.History.KeepLast(1), -1, -1, -1))
    if user_data:
        policies.append(Policy.Userdata(user_data.encode()))
    return Qos(*policies)


Gid = bytes  # 16 of them


@cache
def discovery_types(gid_bytes: int) -> tuple[Any, Any, Any]:
    """Return DDS's classes of a number, of what a program tells of a node, and of all that it tells."""
    gid = _struct("Gid", data=array[idl.uint8, gid_bytes])
    gids = sequence[gid]
    node = _struct("NodeEntitiesInfo", node_namespace=str, node_name=str, reader_gid_seq=gids, writer_gid_seq=gids)
    return gid, node, _struct("ParticipantEntitiesInfo", gid=gid, node_entities_info_seq=sequence[node])


def _struct(name: str, **members: Any) -> Any:
    return make_idl_struct(f"{name}_", f"rmw_dds_common::msg::dds_::{name}_", members)


_TAKEN_AT_ONCE = 1000  # of anything that is taken at once
_HANDLES = 2**64  # what Cyclone calls ends of topics by; its Python gives half of them as negative numbers


@dataclass(frozen=True, eq=False)
class Endpoint:
    """An end of a topic: a writer or a reader, of this program or another. One that comes back is another object."""

    guid: Gid
    participant: Gid  # program's
    topic: str  # DDS's name
    type_name: str  # DDS's
    quality: Quality  # that it offers, or asks for


class Directory:
    """What DDS has discovered, brought up to date by `refresh`; threads take turns."""

    def __init__(self, participant: DomainParticipant, discovery: DataReader[Any], own: tuple[Gid, str]) -> None:
        """Begin to look; `discovery` reads ros_discovery_info, `own` are this program's number and node."""
        self._own = own
        self._ends = (
            BuiltinDataReader(participant, BuiltinTopicDcpsPublication),
            BuiltinDataReader(participant, BuiltinTopicDcpsSubscription),
        )
        self._discovery = discovery
        self.publications: dict[int, Endpoint] = {}  # by Cyclone's handle
        self.subscriptions: dict[int, Endpoint] = {}
        self._nodes: dict[Gid, dict[Gid, str]] = {}  # of a program: its endpoints, and its nodes' names
        self.changes = 0  # seen so far
        self.readers: tuple[DataReader[Any], ...] = (*self._ends, discovery)
        for reader in self.readers:
            reader.set_status_mask(DDSStatus.DataAvailable)

    def refresh(self) -> list[Endpoint]:
        """Take in what is new; return the ends of topics that have come."""
        came: list[Endpoint] = []
        for reader, known in zip(self._ends, (self.publications, self.subscriptions), strict=True):
            for sample in taken(reader):
                self.changes += 1
                handle = sample.sample_info.instance_handle % _HANDLES
                if not sample.sample_info.valid_data:
                    known.pop(handle, None)
                elif handle not in known:
                    kept, reliable = sample.qos[Policy.Durability], sample.qos[Policy.Reliability]
                    is_reliable = isinstance(reliable, Policy.Reliability.Reliable)
                    quality = Quality(is_reliable, kept not in (None, Policy.Durability.Volatile))
                    ids = sample.key.bytes, sample.participant_key.bytes
                    known[handle] = Endpoint(*ids, sample.topic_name, sample.type_name, quality)
                    came.append(known[handle])
        for message in taken(self._discovery):
            if message.sample_info.valid_data:
                self.changes += 1
                self._nodes[bytes(message.gid.data)[:16]] = {
                    bytes(gid.data)[:16]: f"{node.node_namespace.rstrip('/')}/{node.node_name}"
                    for node in message.node_entities_info_seq
                    for gid in (*node.reader_gid_seq, *node.writer_gid_seq)
                }
        return came

    def node(self, end: Endpoint) -> str:
        """Return the name of the node that an end belongs to; its program's number where that is no ROS node."""
        if end.participant == self._own[0]:
            return self._own[1]
        return self._nodes.get(end.participant, {}).get(end.guid, f"{UNNAMED_NODE}{end.participant.hex()}")

    def process(self, end: Endpoint) -> str:
        """Return the node's name, a space, and what differs when it is started again."""
        return f"{self.node(end)} {end.participant.hex()}"

    def publishers(self, dds_name: str) -> list[Endpoint]:
        """Return who publishes a topic."""
        return [end for end in tuple(self.publications.values()) if end.topic == dds_name]

    def published(self) -> Iterator[tuple[str, str, Endpoint]]:
        """Return the topics of ROS that are published, each with its type and who publishes it."""
        for end in tuple(self.publications.values()):
            topic = ros_topic(end.topic)
            if topic is not None:
                yield topic, ros_type(end.type_name), end

    def names(self, ends: Iterable[Endpoint]) -> tuple[str, ...]:
        """Return the names of the nodes that ends belong to."""
        return tuple(sorted({self.node(end) for end in ends}))


def taken(reader: DataReader[Any]) -> Iterator[Any]:
    """Return all that a reader has."""
    while True:
        samples = reader.take(_TAKEN_AT_ONCE)
        yield from samples
        if len(samples) < _TAKEN_AT_ONCE:
            return


_LOOK_EVERY_NS = 100_000_000  # [ns] between looks where nothing comes
_LET_GO_AFTER_S = 0.02  # [s] after which nobody else refers to what was ended
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
            # more than one of them is kept, since programs are not distinguished
            data_reader = DataReader(self._participant, topic, profile(Quality(is_latched=True), _TAKEN_AT_ONCE))
            self.directory = Directory(self._participant, data_reader, (self.gid, self.node))
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

    def writer(self, dds_name: str, type_name: str, quality: Quality, depth: int) -> DataWriter[Any]:
        """Begin to publish; `end` ends it."""
        user_data = self.distribution.said_of(message_hash(type_name))
        with self.lock:
            made = DataWriter(self._participant, self._topic(dds_name, type_name), profile(quality, depth, user_data))
            self._begin(made)
        return made

    def reader(
        self, dds_name: str, type_name: str, quality: Quality, depth: int, taker: Callable[[Any], None]
    ) -> DataReader[Any]:
        """Begin to receive: `taker` takes from the reader, in the receiver's thread; `end` ends it."""
        user_data = self.distribution.said_of(message_hash(type_name))
        with self.lock:
            made = DataReader(self._participant, self._topic(dds_name, type_name), profile(quality, depth, user_data))
            made.set_status_mask(DDSStatus.DataAvailable)
            self._takers[id(made)] = lambda: taker(made)
            self._waitset.attach(made)
            self._begin(made)
        return made

    def _begin(self, made: Any) -> None:
        self._ends[made] = made.guid.bytes
        self._tell()

    def end(self, reader_or_writer: Any) -> None:
        """Delete a reader or a writer, by dropping the last reference to it; the caller must not keep one."""
        with self.lock:
            if self._ends.pop(reader_or_writer, None) is None:
                return
            self._ended.append((time.monotonic() + _LET_GO_AFTER_S, reader_or_writer))
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
                number_type, node_type, program_type = discovery_types(self.distribution.gid)
                ends: tuple[list[Any], list[Any]] = ([], [])  # readers, writers
                for one, gid in self._ends.items():
                    ends[isinstance(one, DataWriter)].append(number_type(data=self._padded(gid)))
                node = node_type(self._namespace, self._node, *ends)
                self._presence.write(program_type(number_type(data=self._padded(self.gid)), [node]))

    def _padded(self, gid: Gid) -> list[int]:
        return list(gid.ljust(self.distribution.gid, b"\0"))

    def ends(self, known: Mapping[int, Endpoint], handles: Iterable[int]) -> list[Endpoint]:
        """Return the endpoints of these handles; they are looked up only where one is unknown."""
        unsigned = [handle % _HANDLES for handle in handles]
        if not known.keys() >= set(unsigned):
            self.look()
        return [known[handle] for handle in unsigned if handle in known]

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

    def _topic(self, dds_name: str, type_name: str) -> Topic[Any]:
        try:
            return Topic(self._participant, dds_name, message_type(type_name))
        except DDSException as error:
            raise TransportError(f"DDS topic {dds_name}: {error}") from error

    def _tell(self) -> None:
        self._is_told = False
        self._waitset.set_trigger(True)

    def _receive(self) -> None:
        while not self._stopped:
            self._waitset.wait(round(_LET_GO_AFTER_S * 1e9) if self._ended else _LOOK_EVERY_NS)
            self._waitset.set_trigger(False)
            try:
                self.look()
            except Exception:  # one message, or one program, must not end it
                _logger.exception("receiver of %s", self._node)
            self._let_go()
        self._leave()

    def _let_go(self) -> None:
        """Delete ended readers and writers, in this thread."""
        with self.lock:
            now = time.monotonic()
            over = [one for at, one in self._ended if at <= now]
            self._ended = [pair for pair in self._ended if pair[0] > now]
        over.clear()
