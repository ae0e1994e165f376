"""What every dialect of DIALECTS keeps to: topics that exist and are documented, a robot that speaks and obeys it."""

import re
from pathlib import Path

import pytest

from catenary.crtk.dialects import DIALECTS
from catenary.crtk.message import message_class
from catenary.crtk.topic_names import NAMESPACES, find_topic, topics
from catenary.crtk.transport import absolute
from served_robot import ServedRobot

PAGE = Path(__file__).parents[2] / "docs" / "crtk-topics.md"
READ = {"measured_js", "setpoint_js", "operating_state"}  # what a client needs of an arm
SENT = {"servo_jp", "state_command"}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_topic_has_a_known_type_a_name_and_is_listed_once(dialect: str) -> None:
    listed = topics(dialect)
    assert len({topic.name for topic in listed}) == len(listed)
    for topic in listed:
        message_class(topic.type)
        assert absolute(topic.name) == topic.name
        assert find_topic(dialect, topic.verb, topic.arm) == topic


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_page_lists_every_topic_with_its_type(dialect: str) -> None:
    listed = set()
    for names, kind in re.findall(r"^\| (`[^|]*)\|([^|]*)\|", PAGE.read_text(), re.MULTILINE):
        for name in re.findall(r"`([^`]+)`", names):
            places = [name] if name.startswith("/") else [f"{place}/{name}" for place in NAMESPACES.values()]
            listed |= {(place, kind.strip()) for place in places}
    missing = [t for t in topics(dialect) if (t.name, t.type) not in listed]
    assert not missing


@pytest.mark.parametrize("dialect", DIALECTS)
def test_it_is_told_in_words_and_has_what_a_client_reads_and_sends(dialect: str) -> None:
    kind = DIALECTS[dialect]
    assert str(kind) == f"{dialect}: {kind.words}"
    directions = {topic.verb: topic.direction for topic in kind.topics("gold")}
    assert {verb for verb, way in directions.items() if way == "out"} >= READ
    assert {verb for verb, way in directions.items() if way == "in"} >= SENT


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_served_robot_knows_every_verb_of_an_arm(dialect: str) -> None:
    robot = ServedRobot(dialect)
    for topic in DIALECTS[dialect].topics("gold"):
        if topic.direction == "in" and not topic.commands_state:
            publisher = robot.client.publisher(topic.name, topic.type)
            robot.tick(2)
            publisher.publish(message_class(topic.type)())
            robot.tick(2)
    unknown = [kind for kind, report in robot.server.reports.kinds.items() if "no such arm" in report.text]
    assert not unknown
