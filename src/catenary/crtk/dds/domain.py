"""The DDS domain of a process: which one, and who is heard there, by ROS 2's environment variables.

ROS_DOMAIN_ID (0); ROS_AUTOMATIC_DISCOVERY_RANGE (SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT), ROS_STATIC_PEERS, and
ROS_LOCALHOST_ONLY of distributions up to Humble. What CYCLONEDDS_URI says comes last and overrules, as with
rmw_cyclonedds.
"""

import os
import threading

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain

from catenary.errors import InputError, TransportError

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
LARGEST = 232  # number of a domain, by the ports that DDS makes of it
_MOST_PROGRAMS = 120  # on one machine that find each other without multicast
_FAST_DDS = "1.15"  # its vendor's number; from version 3 on (Kilted) both disagree on what is said of types
_MOST_BYTES = 2**26  # of a message from the network
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
