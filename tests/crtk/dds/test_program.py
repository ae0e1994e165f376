import subprocess
import sys
from xml.etree import ElementTree

import pytest

from catenary.errors import InputError
from dds import VARIABLES, environment, free_domain, require_dds


@pytest.fixture(autouse=True)
def _plain(monkeypatch: pytest.MonkeyPatch) -> None:
    require_dds()
    for name in (*VARIABLES, "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("text", ["233", "-1", "1.5", "one", "٣"])
def test_a_domain_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    from catenary.crtk.dds.program import enter_domain

    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match=r"ROS_DOMAIN_ID .*: expected a whole number from 0 to 232"):
        enter_domain()


def test_the_domain_is_0_where_none_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from catenary.crtk.dds.program import domain_number

    assert domain_number() == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", " 42 ")
    assert domain_number() == 42


@pytest.mark.parametrize(
    ("name", "value"), [("ROS_AUTOMATIC_DISCOVERY_RANGE", "PLANET"), ("ROS_STATIC_PEERS", "10.0.0.1;<Peer/>")]
)
def test_a_variable_that_has_no_such_value_is_refused(monkeypatch, name: str, value: str) -> None:
    from catenary.crtk.dds.program import enter_domain

    monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=name):
        enter_domain()


FIND = """
import sys, time
from catenary.crtk.dds.transport import DdsTransport
with DdsTransport(sys.argv[1], settle=0.2) as transport:
    transport.publisher(f"/{sys.argv[1]}", "std_msgs/String")
    end = time.monotonic() + float(sys.argv[3])
    while time.monotonic() < end and f"/{sys.argv[2]}" not in transport.topics():
        time.sleep(0.05)
    print(f"/{sys.argv[2]}" in transport.topics(), flush=True)
    time.sleep(2.0)
"""


def _find(domain: int, seconds: float, first: dict[str, str], second: dict[str, str]) -> list[str]:
    """Whether two programs find each other, in the environments given, without settings of Cyclone's."""
    variables = environment(domain)
    del variables["CYCLONEDDS_URI"]
    programs = [
        subprocess.Popen(
            [sys.executable, "-c", FIND, *names, str(seconds)],
            env={**variables, **changed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for names, changed in ((("one", "other"), first), (("other", "one"), second))
    ]
    return [program.communicate(timeout=120.0)[0].strip() for program in programs]


@pytest.mark.slow
@pytest.mark.parametrize("local", [{"ROS_LOCALHOST_ONLY": "1"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}])
def test_programs_that_keep_to_the_machine_find_each_other(local: dict[str, str]) -> None:
    assert _find(free_domain(), 40.0, local, local) == ["True", "True"]


@pytest.mark.slow
def test_a_program_that_is_off_is_found_by_nobody() -> None:
    local = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    off = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    assert _find(free_domain(), 4.0, local, off) == ["False", "False"]


def test_settings_of_cyclone_that_are_none_are_refused_by_name(tmp_path) -> None:
    code = "from catenary.crtk.dds.program import enter_domain; enter_domain()"
    variables = {**environment(free_domain()), "CYCLONEDDS_URI": "<CycloneDDS><Nonsense/></CycloneDDS>"}
    ended = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=False)
    assert "TransportError" in ended.stderr
    assert "CYCLONEDDS_URI" in ended.stderr


@pytest.mark.parametrize("wide", ["SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT"])
@pytest.mark.parametrize("own", ["", "<CycloneDDS><Domain><Id>any</Id></Domain></CycloneDDS>"])
def test_types_of_fast_dds_are_not_compared_whatever_else_is_set(monkeypatch, wide: str, own: str) -> None:
    from catenary.crtk.dds import program as domain

    given: list[str] = []
    monkeypatch.setattr(domain, "Domain", lambda number, settings: given.append(settings))
    monkeypatch.setattr(domain, "_domains", {})
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", wide)
    monkeypatch.setenv("CYCLONEDDS_URI", own)
    domain.enter_domain()
    (settings,) = given
    ours = ElementTree.fromstring(settings.removesuffix(f",{own}"))
    # eProsima's number among DDS's vendors
    assert [one.text for one in ours.findall("Domain/Compatibility/IgnoreTypeInformation")] == ["1.15"]
    assert settings.endswith(own)  # comes last and overrules


def test_a_middleware_that_is_none_of_dds_is_told(monkeypatch: pytest.MonkeyPatch, caplog) -> None:
    from catenary.crtk.dds.program import enter_domain

    for name, value in environment(free_domain()).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
    enter_domain()
    assert "rmw_zenoh_cpp, which does not use DDS" in caplog.text
