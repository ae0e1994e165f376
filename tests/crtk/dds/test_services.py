import gc
import threading
from typing import Any

import numpy as np
import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class
from catenary.errors import InputError, TransportError
from patience import PATIENCE, polled, until

TRIGGER = "std_srvs/Trigger"
RESPONSE = message_class("std_srvs/TriggerResponse")


def test_a_client_like_rmw_cyclonedds_gets_its_own_answers(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import TriggerRequest, TriggerResponse

    pressed: list[int] = []

    def press(_: Any) -> Any:
        pressed.append(1)
        return RESPONSE(True, f"pressed {len(pressed)} times")

    robot.service("/button", TRIGGER, press)
    requests = peer.writer("rq/buttonRequest", TriggerRequest)
    answers = peer.reader("rr/buttonReply", TriggerResponse)
    until(lambda: requests.get_matched_subscriptions() and answers.get_matched_publications())
    client = requests.instance_handle % 2**64
    with polled(robot):
        for number in (7, 8):
            requests.write(TriggerRequest(client, number))
            got = answers.take_one(timeout=round(PATIENCE * 1e9))
            assert (got.guid, got.seq, got.success) == (client, number, True)
    assert got.message == "pressed 2 times"


def test_a_service_like_rmw_cyclonedds_is_called(robot: Any, peer: Any) -> None:
    from threading import Thread

    from oracles.cyclone_peer import TriggerRequest, TriggerResponse

    requests = peer.reader("rq/buttonRequest", TriggerRequest)
    answers = peer.writer("rr/buttonReply", TriggerResponse)

    def serve() -> None:
        asked = requests.take_one(timeout=round(PATIENCE * 1e9))
        answers.write(TriggerResponse(asked.guid + 1, asked.seq, True, "another's"))
        answers.write(TriggerResponse(asked.guid, asked.seq - 1, True, "another one"))
        answers.write(TriggerResponse(asked.guid, asked.seq, True, "this one"))

    server = Thread(target=serve, daemon=True)
    server.start()
    assert robot.call("/button", TRIGGER, timeout=PATIENCE) == (True, "this one")
    server.join()


def test_a_service_between_two_programs_is_found_offered_once_and_forgotten(robot: Any, dds_domain: int) -> None:
    with DdsTransport("client", settle=0.05) as client:
        robot.service("/button", TRIGGER, lambda _: RESPONSE(True, "yes"))
        with polled(robot):
            assert client.call("/button", TRIGGER, timeout=PATIENCE) == (True, "yes")
        with pytest.raises(TransportError, match="offered already"):
            client.service("/button", TRIGGER, print)
        with pytest.raises(TransportError, match=r"no answer within 0\.2 s"):
            client.call("/button", TRIGGER, timeout=0.2)
        robot.close()
        with pytest.raises(TransportError, match="nobody offers it"):
            client.call("/button", TRIGGER, timeout=0.5)
        client.service("/button", TRIGGER, print)


def test_a_server_that_is_late_answers_nobody_who_has_gone(robot: Any, dds_domain: int) -> None:
    with DdsTransport("client", settle=0.05) as client:
        robot.service("/button", TRIGGER, lambda _: RESPONSE(True, "late"))

        def asked_in_vain() -> bool:
            with pytest.raises(TransportError) as refused:
                client.call("/button", TRIGGER, timeout=0.3)
            return "no answer" in str(refused.value)  # nobody offers it until the robot is discovered

        until(asked_in_vain)
        until(lambda: robot.poll(0.05))
        with polled(robot):
            assert client.call("/button", TRIGGER, timeout=PATIENCE).success


def test_a_service_with_messages_in_it_answers_and_says_why_it_failed(robot: Any) -> None:
    kind, response = ("crtk_msgs/QueryForwardKinematics", message_class("crtk_msgs/QueryForwardKinematicsResponse"))
    pose = message_class("geometry_msgs/Pose")

    def answer(request: Any) -> Any:
        if len(request.jp) != 3:
            raise InputError(f"{len(request.jp)} joints")
        point = message_class("geometry_msgs/Point")(*request.jp)
        return response(pose(position=point), True, "here")

    robot.service("/fk", kind, answer)
    asked = message_class("crtk_msgs/QueryForwardKinematicsRequest")
    with polled(robot):
        got = robot.call("/fk", kind, asked(jp=np.array([0.25, -1.0, 4.0])), timeout=PATIENCE)
        failed = robot.call("/fk", kind, asked(jp=np.ones(2)), timeout=PATIENCE)
    assert (tuple(got.cp.position), got.result, got.message) == ((0.25, -1.0, 4.0), True, "here")
    assert (failed.result, failed.message) == (False, "2 joints")


def test_the_receiver_alone_lets_dds_delete_so_that_no_ctrl_c_is_lost(
    dds_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is raised in `__del__` Python ignores, and Ctrl-C is raised in the main thread."""
    from cyclonedds.core import Entity

    threads: list[str] = []
    delete = Entity.__del__

    def noting(entity: Entity) -> None:
        threads.append(threading.current_thread().name)
        delete(entity)

    with DdsTransport("offers", settle=0.05) as offers, DdsTransport("asks", settle=0.05) as asks:
        offers.service("/press", TRIGGER, lambda _: RESPONSE(True, ""))
        gc.collect()  # what other tests left
        monkeypatch.setattr(Entity, "__del__", noting)
        with polled(offers):
            assert asks.call("/press", TRIGGER).success
        publisher = asks.publisher("/a", "std_msgs/Bool")
        heard = asks.subscribe("/a", "std_msgs/Bool")
        publisher.close()
        heard.close()
        until(lambda: len(threads) >= 4)
    gc.collect()
    assert set(threads) == {"asks receiver", "offers receiver"}
