"""What a served robot says, byte for byte, beside the same messages made and encoded one by one."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.bundle import Bundle
from catenary.crtk.conversions import joint_state_message, operating_state_message, pose_message
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.names import find_topic
from catenary.crtk.wire import codec
from catenary.nodes.serve import Serving, make_server
from oracles.cable_arms import homed_plant

LENGTH = 4  # bytes in front of a message


class Overheard(Loopback):
    """A transport that remembers the sheet that it sends."""

    sheet: Any = None
    spoken: Any = ()

    def bundle(self, publishers: Any, sheet: Any) -> Bundle:
        self.sheet = sheet
        self.spoken = [publisher.topic for publisher in publishers]
        return super().bundle(publishers, sheet)


@pytest.fixture(params=["raven", "crtk"])
def said(request: pytest.FixtureRequest) -> Any:
    """A robot with two arms that move, and what it says on each topic in its last tick."""
    network = LoopbackNetwork()
    transport, client = Overheard("robot", network), Loopback("client", network)
    plants: Any = {"gold": homed_plant("left"), "green": homed_plant("right")}
    server = make_server(Serving(dialect=request.param), transport, plants=plants)
    for topic in transport.spoken:
        client.subscribe(topic, transport.topics()[topic])
    for outlet in server.outlets.values():
        outlet.watch()
    rng = np.random.default_rng(5)
    for _ in range(40):
        for arm in server.arms.values():
            arm.increment(rng.uniform(-1.0, 1.0, 7) * arm.most)
        server.tick()
    frames = {topic: bytes(transport.sheet.frame(k)) for k, topic in enumerate(transport.spoken)}
    return request.param, server, frames


def frame_on(said: Any, verb: str, arm: Any) -> tuple[bytes, int, int]:
    """A topic's frame, and the stamp and seq in it."""
    dialect, _, frames = said
    topic = find_topic(dialect, verb, arm)
    message = codec(topic.type).decode(frames[topic.name][LENGTH:])
    head = message.hdr if hasattr(message, "hdr") else message.header
    return frames[topic.name], head.stamp, head.seq


def same(frame: bytes, type_name: str, message: Any, seq: int) -> bool:
    data = codec(type_name).encode(message, seq)
    return frame == len(data).to_bytes(4, "little") + data


@pytest.mark.parametrize("arm", ["gold", "green"])
def test_joint_states_are_the_bytes_of_messages_made_anew(said: Any, arm: Any) -> None:
    served = said[1].arms[arm]
    for verb, state in (("measured_js", served.measured), ("setpoint_js", served.setpoint)):
        frame, stamp, seq = frame_on(said, verb, arm)
        made = joint_state_message(served.names, stamp, state.q, state.qd, state.tau)
        assert np.abs(state.q).min() > 0.0
        assert same(frame, "sensor_msgs/JointState", made, seq)


@pytest.mark.parametrize("arm", ["gold", "green"])
def test_the_jaws_are_the_bytes_of_messages_made_anew(said: Any, arm: Any) -> None:
    dialect, server, _ = said
    verb, name = ("grasp_measured_js", "grasp") if dialect == "raven" else ("jaw/measured_js", "jaw")
    frame, stamp, seq = frame_on(said, verb, arm)
    q, qd, tau = (values[-2:] for values in server.arms[arm].measured[1:4])
    made = joint_state_message((name,), stamp, [q.sum()], [qd.sum()], [tau.mean()])
    assert same(frame, "sensor_msgs/JointState", made, seq)


@pytest.mark.parametrize("arm", ["gold", "green"])
def test_poses_are_those_of_forward_kinematics_in_the_bytes_of_their_type(said: Any, arm: Any) -> None:
    served, child = said[1].arms[arm], "tool" if said[0] == "raven" else None
    for verb, q in (("measured_cp", served.measured.q), ("setpoint_cp", served.setpoint.q)):
        frame, stamp, seq = frame_on(said, verb, arm)
        made = pose_message(served.tool.pose(q), stamp, "base", child=child)
        kind = find_topic(said[0], verb, arm).type
        read = codec(kind).decode(frame[LENGTH:])
        assert same(frame, kind, read, seq)
        inner, wanted = (one.pose if child is None else one.transform for one in (read, made))
        assert_allclose(inner[0], wanted[0], atol=1e-12)
        sign = np.sign(np.dot(inner[1], wanted[1]))  # both signs are the same rotation
        assert_allclose(np.array(inner[1]) * sign, wanted[1], atol=1e-9)
        assert (read.header.frame_id, read.header.stamp) == ("base", stamp)


@pytest.mark.parametrize("said", ["raven"], indirect=True)
def test_operating_states_are_the_bytes_of_messages_made_anew(said: Any) -> None:
    for arm in ("gold", "green", None):
        frame, stamp, seq = frame_on(said, "operating_state", arm)
        served = said[1].arms[arm or "gold"]
        kind = "crtk_msgs/OperatingState"
        assert same(frame, kind, operating_state_message(served.state, stamp), seq)


@pytest.mark.parametrize("said", ["raven"], indirect=True)
def test_the_whole_state_is_the_bytes_of_a_message_made_anew(said: Any) -> None:
    frame, stamp, seq = frame_on(said, "ravenstate", None)
    degrees = 180.0 / np.pi
    rows: dict[str, Any] = {
        name: np.zeros(16) for name in ("tau", "mpos", "jpos", "mvel", "jvel", "mpos_d", "jpos_d")
    }
    rows |= {name: np.zeros(16) for name in ("encVals", "dac_val", "encoffsets")}
    grasp, positions, turns = np.zeros(2), np.zeros((2, 6)), np.zeros((2, 18))
    for k, arm in enumerate(said[1].arms.values()):
        own, channels = arm.plant.telemetry(), 8 * k + np.array([0, 1, 2, 4, 5, 6, 7])
        for name in rows:
            scale = 1.0 if name in ("tau", "encVals", "dac_val", "encoffsets") else degrees
            rows[name][channels] = scale * own[name]
        grasp[k] = arm.setpoint.q[-2:].sum()
        base = arm.tool.model.frames["frame0"].pose.inverse()
        for row, q in enumerate((arm.measured.q, arm.setpoint.q)):
            pose = base @ arm.tool.pose(q)
            positions[row, 3 * k : 3 * k + 3] = np.trunc(1e6 * pose.position)
            turns[row, 9 * k : 9 * k + 9] = pose.rotation.ravel()
    made = message_class("raven_2/raven_state")(
        header(stamp), runlevel=3, dt=1_000_000, grasp_d=grasp, pos=positions[0], pos_d=positions[1],
        ori=turns[0], ori_d=turns[1], **rows,
    )  # fmt: skip
    read = codec("raven_2/raven_state").decode(frame[LENGTH:])
    assert same(frame, "raven_2/raven_state", read, seq)
    for name in made._fields[1:]:
        wanted = np.asarray(getattr(made, name))
        # poses differ by rounding of forward kinematics, and a whole um where that crosses one
        atol = {"ori": 1e-7, "ori_d": 1e-7, "pos": 1, "pos_d": 1}.get(name, 0.0)
        np.testing.assert_allclose(
            getattr(read, name),
            wanted.astype(np.asarray(getattr(read, name)).dtype),
            rtol=0,
            atol=atol,
            err_msg=name,
        )


def test_nothing_is_written_while_nobody_listens() -> None:
    network = LoopbackNetwork()
    transport = Overheard("robot", network)
    server = make_server(Serving(dialect="crtk"), transport, plants={"gold": homed_plant("left")})
    for outlet in server.outlets.values():
        outlet.watch()
    before = transport.sheet.numbers.copy()
    server.arms["gold"].increment(server.arms["gold"].most)
    server.tick()
    np.testing.assert_array_equal(transport.sheet.numbers, before)
