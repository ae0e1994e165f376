"""The dialects of CRTK by name, one record each: topics, what a robot that speaks it has besides, who serves it."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from catenary.errors import InputError


@dataclass(frozen=True)
class DialectKind:
    """A dialect by name.

    Args:
        name, words: Name as typed, and description in the help.
        topics_by: `module:function` of this room; takes (arm or None for the whole robot, namespace or None).
        served_by: `module:class` of this room; takes (arms by name, topics or None for a RAVEN-II's).
        has_run_levels: Operating states are a RAVEN-II's run levels: a silver button starts the robot, a pedal lets it
            move, and raven_state tells run level and telemetry beside CRTK's topics.
    """

    name: str
    words: str
    topics_by: str
    served_by: str
    has_run_levels: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"

    def topics(self, arm: str | None, namespace: str | None = None) -> Any:
        """Return the CrtkTopics of an arm, or of the whole robot; a namespace is in front of the verbs of one arm."""
        return _named(self.topics_by)(arm, namespace)

    def serve(self, arms: Any, listed: Any = None) -> Any:
        """Return the `serving.dialect.Dialect` that speaks for arms by name, over topics; a RAVEN-II's when None."""
        return _named(self.served_by)(arms, listed)


def _named(place: str) -> Any:  # these records import nothing, since help, which reads them, starts without NumPy
    module, _, name = place.partition(":")
    return getattr(import_module(f"catenary.crtk.{module}"), name)


_KINDS = (
    DialectKind(
        "raven",
        "the public RAVEN-II software's, branch crtk",
        "topic_names:raven_dialect_topics",
        "serving.raven_dialect:RavenDialect",
        has_run_levels=True,
    ),
    DialectKind(
        "crtk", "the present convention's, a dVRK's too", "topic_names:crtk_topics", "serving.crtk_dialect:CrtkDialect"
    ),
)
DIALECTS = {kind.name: kind for kind in _KINDS}


def dialect_named(name: str) -> DialectKind:
    """Return a dialect's record."""
    if name not in DIALECTS:
        raise InputError(f'dialect "{name}": expected one of {", ".join(DIALECTS)}')
    return DIALECTS[name]
