import re
from pathlib import Path

import pytest

from catenary.crtk.message import message_class
from catenary.crtk.topic_names import NAMESPACES, find_topic, topic_name, topics
from catenary.crtk.transport import absolute
from catenary.errors import InputError
from catenary.raven2.topics import _GOLD_MEASURED_JS, _GREEN_MEASURED_JS, RAVENSTATE

PAGE = Path(__file__).parents[2] / "docs" / "crtk-topics.md"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_every_topic_has_a_known_type_a_name_and_is_listed_once(dialect: str) -> None:
    listed = topics(dialect)  # type: ignore[arg-type]
    assert len({topic.name for topic in listed}) == len(listed)
    for topic in listed:
        message_class(topic.type)
        assert absolute(topic.name) == topic.name
        assert find_topic(dialect, topic.verb, topic.arm) == topic  # type: ignore[arg-type]


def test_what_is_recorded_comes_from_these_topics() -> None:
    for recorded, verb, arm in (
        (_GOLD_MEASURED_JS, "measured_js", "gold"),
        (_GREEN_MEASURED_JS, "measured_js", "green"),
        (RAVENSTATE, "ravenstate", None),
    ):
        topic = find_topic("raven", verb, arm)  # type: ignore[arg-type]
        assert (topic.name, topic.type) == (recorded.name, recorded.type)


def test_a_verb_that_no_topic_carries_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=r"raven, gold arm: no topic for \"move_jp\"; there are .*servo_jr"):
        topic_name("raven", "move_jp", "gold")
    with pytest.raises(InputError, match="expected raven or crtk"):
        topics("dvrk")  # type: ignore[arg-type]


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_the_page_lists_every_topic_with_its_type(dialect: str) -> None:
    listed = set()
    for names, kind in re.findall(r"^\| (`[^|]*)\|([^|]*)\|", PAGE.read_text(), re.MULTILINE):
        for name in re.findall(r"`([^`]+)`", names):
            places = [name] if name.startswith("/") else [f"{place}/{name}" for place in NAMESPACES.values()]
            listed |= {(place, kind.strip()) for place in places}
    missing = [t for t in topics(dialect) if (t.name, t.type) not in listed]  # type: ignore[arg-type]
    assert not missing
