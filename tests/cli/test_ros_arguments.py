"""Commands that join ROS 2 with a distribution and names of the user's."""

import pytest
from typer.testing import CliRunner

from catenary.cli.main import app
from catenary.crtk import network
from catenary.crtk.dds.arguments import RosArguments, said_ros_arguments, say_ros_arguments
from catenary.crtk.loopback import Loopback
from catenary.errors import InputError

RUN = CliRunner()


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, RosArguments]]:
    """How networks are joined; in truth none is."""
    seen: list[tuple[str, RosArguments]] = []

    def join(ros: str, name: str) -> Loopback:
        seen.append((ros, said_ros_arguments()))
        return Loopback("program")

    monkeypatch.setattr(network, "make_transport", join)
    return seen


def test_a_distribution_and_names_reach_the_network(joined: list[tuple[str, RosArguments]]) -> None:
    words = "button --ros 2 --ros-distro humble --ros-args -r /silver_button:=/lab/button -r __ns:=/lab"
    RUN.invoke(app, words.split())
    assert joined == [("2", RosArguments({"/silver_button": "/lab/button"}, None, "/lab", "humble"))]
    RUN.invoke(app, ["button", "--ros", "2"])
    assert joined[1:] == [("2", RosArguments())]  # nothing is left of those before


def test_a_command_that_is_on_no_ros_takes_none_of_it() -> None:
    found = RUN.invoke(app, ["fit", "data.parquet", "--ros-args", "-r", "a:=b"])
    assert found.exit_code == 2
    assert "No such option" in found.output


@pytest.mark.parametrize("said", [RosArguments(distro="humble"), RosArguments({"/a": "/b"})])
def test_ros_1_and_none_refuse_what_is_for_ros_2(said: RosArguments) -> None:
    say_ros_arguments(said)
    try:
        for ros in ("1", "none"):
            with pytest.raises(InputError, match="go with ROS 2"):
                network.make_transport(ros, "one")
    finally:
        say_ros_arguments(RosArguments())
