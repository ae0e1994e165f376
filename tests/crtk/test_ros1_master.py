import math
import socket
import threading

import pytest

from catenary.crtk.ros1 import master as ros1_master
from catenary.crtk.ros1.master import _ANSWER_WITHIN_S, Master, bound_to_all, master_uri
from catenary.errors import TransportError
from ros import free_port


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long it is waited at most [s], each time: on a machine that is busy as on any other."""
    found: list[float] = []
    ours, join = threading.current_thread(), threading.Thread.join

    def joined(thread: threading.Thread, timeout: float | None = None) -> None:
        if threading.current_thread() is ours:  # and not another test's node, which asks its master all the time
            found.append(math.inf if timeout is None else timeout)
        join(thread, timeout)

    monkeypatch.setattr(threading.Thread, "join", joined)
    monkeypatch.setattr(ros1_master, "_ANSWER_WITHIN_S", _ANSWER_WITHIN_S)  # which other tests lengthen
    return found


@pytest.mark.parametrize("host", ["nobody", "somebody silent", "no host"])
def test_a_master_that_does_not_answer_is_told_within_three_seconds(host: str, limits: list[float]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        uri = {
            "nobody": f"http://127.0.0.1:{free_port()}",
            "somebody silent": f"http://127.0.0.1:{silent.getsockname()[1]}",
            "no host": "http://robot.invalid:11311",
        }[host]
        with pytest.raises(TransportError, match=rf"no ROS master at {uri}.*roscore.*ROS_MASTER_URI"):
            Master(uri, "/tests").pid()
    assert 0.0 < sum(limits) <= 3.0


@pytest.mark.parametrize("uri", ["", "localhost:11311", "http://localhost", "http://:11311", "ftp://a:1", "http://a:b"])
def test_a_uri_that_is_none_is_refused(uri: str) -> None:
    with pytest.raises(TransportError, match="expected http://HOST:PORT"):
        Master(uri, "/tests")


def test_uri_is_the_one_given_then_the_environments_then_this_machines(monkeypatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot:11311")
    assert master_uri("http://other:1") == "http://other:1"
    assert master_uri() == "http://robot:11311"
    monkeypatch.delenv("ROS_MASTER_URI")
    assert master_uri() == "http://localhost:11311"


@pytest.mark.parametrize(
    ("environment", "said"),
    [
        ({}, "ROS_IP and ROS_HOSTNAME are not set"),
        ({"ROS_IP": "192.168.1.20"}, "only says what others call it (192.168.1.20)"),
        ({"ROS_HOSTNAME": "lab", "ROS_IP": "127.0.0.1"}, "(lab)"),
        ({"ROS_IP": "127.0.0.1"}, None),
        ({"ROS_HOSTNAME": "localhost"}, None),
    ],
)
def test_a_node_that_listens_on_all_addresses_is_warned_of(environment, said):
    warning = bound_to_all(environment)
    if said is None:
        assert warning is None
    else:
        assert said in warning
        assert "ROS_IP=127.0.0.1 restricts it to this machine" in warning
