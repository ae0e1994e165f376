import pytest

from catenary.crtk.topic_names import find_topic, topics
from catenary.errors import InputError
from catenary.raven2.topics import _GOLD_MEASURED_JS, _GREEN_MEASURED_JS, RAVENSTATE


def test_what_is_recorded_comes_from_these_topics() -> None:
    for recorded, verb, arm in (
        (_GOLD_MEASURED_JS, "measured_js", "gold"),
        (_GREEN_MEASURED_JS, "measured_js", "green"),
        (RAVENSTATE, "ravenstate", None),
    ):
        topic = find_topic("raven", verb, arm)
        assert (topic.name, topic.type) == (recorded.name, recorded.type)


def test_a_verb_that_no_topic_carries_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=r"raven, gold arm: no topic for \"move_jp\"; there are .*servo_jr"):
        find_topic("raven", "move_jp", "gold")
    with pytest.raises(InputError, match="expected one of raven, crtk"):
        topics("dvrk")
