"""A topic as it is recorded: its columns, their units, and what its numbers are multiplied by to be in SI."""

from dataclasses import dataclass

SECOND = 1_000_000_000  # [ns]


@dataclass(frozen=True)
class TopicColumn:
    """One quantity of a topic, a number per label."""

    name: str  # in telemetry
    path: str  # in the message
    labels: tuple[str, ...]  # of its numbers; a single empty one where the name says it all
    units: tuple[str, ...]  # SI, one per label; "" where it has none or nobody states it
    to_si: float = 1.0  # SI = published * to_si
    whole: bool = False  # a whole number: counts, levels
    required: bool = False  # of telemetry; what else it lacks is published as zero

    @property
    def width(self) -> int:
        """Count of its numbers."""
        return len(self.labels)

    @property
    def paths(self) -> tuple[str, ...]:
        """Place of each number in the message, as a mapping names it."""
        return tuple(f"{self.path}[{label}]" if label else self.path for label in self.labels)


@dataclass(frozen=True)
class Topic:
    """A topic as it is recorded."""

    name: str
    type: str
    rate: float  # [Hz] at which it is recorded
    columns: tuple[TopicColumn, ...]
    bag: str  # of the bag that RAVEN's group records it in
    header: str = "header"  # field that holds the stamp
    joint_names: tuple[str, ...] = ()  # sent along in a JointState


def joint_topic(name: str, column: str, joints: tuple[str, ...], *, rate: float, bag: str, unit: str = "") -> Topic:
    """Return a topic of JointState messages, whose velocity and effort may be absent.

    Args:
        column: Name of its positions in a recording.
        rate: Messages per second [Hz].
        bag: Name of its bag, for RAVEN's programs.
        unit: Unit of all positions; without one insertions are in m, other joints in rad.
    """

    def of_joints(suffix: str, path: str, angular: str, linear: str) -> TopicColumn:
        units = tuple(linear if joint.endswith("insertion") else angular for joint in joints)
        return TopicColumn(column + suffix, path, joints, units, required=path == "position")

    angular, linear = unit or "rad", unit or "m"
    columns = (
        of_joints("", "position", angular, linear),
        of_joints("_velocity", "velocity", f"{angular}/s", f"{linear}/s"),
        of_joints("_effort", "effort", "Nm", "N"),
    )
    return Topic(name, "sensor_msgs/JointState", rate, columns, bag, joint_names=joints)
