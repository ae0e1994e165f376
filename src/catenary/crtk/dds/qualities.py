"""ROS 2's qualities of service: what a publisher offers, what a subscriber asks for, and why the two may not meet."""

from typing import NamedTuple

from cyclonedds.qos import Policy, Qos

_NEVER = 0  # [ns] that a publisher waits for its readers


class Quality(NamedTuple):
    """What peers have to agree on; a reader gets nothing of a writer that offers less than it asks for."""

    is_reliable: bool = True  # lost messages are sent again; else best effort, as of sensors
    is_latched: bool = False  # transient local: whoever comes later gets the last message; else volatile
    is_plain: bool = True  # CDR of version 1, the only one that ROS 2 speaks

    def __str__(self) -> str:
        """Say it in ROS 2's words."""
        words = ["reliable" if self.is_reliable else "best effort"]
        words.append("transient local" if self.is_latched else "volatile")
        return ", ".join(words if self.is_plain else [*words, "CDR version 2 only"])

    def lacks(self, asked: "Quality") -> tuple[str, ...]:
        """Return what a reader asks for and this, a writer's, does not offer, in ROS 2's names of policies."""
        found = []
        if asked.is_reliable and not self.is_reliable:
            found.append("reliability")
        if asked.is_latched and not self.is_latched:
            found.append("durability")
        if asked.is_plain is not self.is_plain:
            found.append("data representation")
        return tuple(found)


def profile(quality: Quality, depth: int, user_data: str = "") -> Qos:
    """Return the policies of a reader or writer that keeps `depth` messages."""
    policies = [
        Policy.Reliability.Reliable(_NEVER) if quality.is_reliable else Policy.Reliability.BestEffort,
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


def quality_of(qos: Qos) -> Quality:
    """Return what a peer offers or asks for, as DDS's discovery tells."""
    representation = qos[Policy.DataRepresentation]
    return Quality(
        isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable),
        qos[Policy.Durability] not in (None, Policy.Durability.Volatile),
        representation is None or representation.use_cdrv0_representation,
    )


def user_data_of(qos: Qos) -> dict[str, str]:
    """Return what a peer says of itself: `key=value;` and so on."""
    data = qos[Policy.Userdata]
    text = "" if data is None else data.data.decode("utf-8", "replace")
    pairs = (part.partition("=") for part in text.split(";"))
    return {key: value for key, found, value in pairs if found}
