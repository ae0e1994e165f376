"""What is missing of a recording that was interrupted or damaged, topic by topic."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from catenary.topics import SECOND

# [ns] arrivals of the last message before what could not be read and of the first behind it; None at an end
Hole = tuple[int | None, int | None]


class TopicLoss(NamedTuple):
    """Messages of a topic that are there, and about how many are not."""

    topic: str
    kept: int
    lost: int  # as the rate of the others tells
    seconds: float  # without a message, beyond the usual interval


@dataclass(frozen=True)
class Rescue:
    """What is there of a recording that was not whole, and what is not."""

    topics: tuple[TopicLoss, ...]
    seconds: float  # from the first message to the last
    ends_early: bool  # it was cut off: its end is missing

    @classmethod
    def of(cls, arrivals: Mapping[str, NDArray[np.int64]], holes: Sequence[Hole], *, ends_early: bool) -> Self:
        """Compare topics with one another.

        A topic goes on at its usual rate, the median of its intervals; so many messages are missing as would fit
        between the last before a hole and the first behind it. What came behind the end of a recording nobody knows: it
        is not counted, but for topics that end before others do. Arrivals are (M,) [ns] of each topic, in order.
        """
        there = [a for a in arrivals.values() if len(a)]
        span = max(int(a[-1]) for a in there) - min(int(a[0]) for a in there) if there else 0
        found = []
        for topic, arrival in arrivals.items():
            usual = int(np.median(np.diff(arrival))) if len(arrival) > 1 else 0
            lost, without = 0, 0
            places = {int(np.searchsorted(arrival, at, side="right")) for at, _ in holes if at is not None} - {0}
            for place in places if usual > 0 else ():
                following = int(arrival[place]) if place < len(arrival) else max(int(a[-1]) for a in there)
                gap = following - int(arrival[place - 1])
                lost += max(0, round(gap / usual) - (place < len(arrival)))
                without += max(0, gap - usual)
            found.append(TopicLoss(topic, len(arrival), lost, without / SECOND))
        return cls(tuple(found), span / SECOND, ends_early)

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        topics = [one._asdict() | {"seconds": round(one.seconds, 3)} for one in self.topics]
        return {"seconds": round(self.seconds, 3), "ends_early": self.ends_early, "topics": topics}

    def text(self) -> str:
        """Return this in words."""
        kept = ", ".join(f"{one.kept} messages of {one.topic}" for one in self.topics) or "nothing"
        lost = [f"about {one.lost} of {one.topic} ({one.seconds:.2f} s)" for one in self.topics if one.lost]
        if self.ends_early:
            lost.append("what came in the last 0.5 s before it was cut off, and all behind that")
        return f"kept {self.seconds:.1f} s: {kept}; lost: {', '.join(lost) or 'no message'}"
