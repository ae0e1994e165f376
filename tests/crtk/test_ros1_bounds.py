"""What peers of a ROS 1 node, and callers of it, may send: it goes on, in little memory."""

import json
import socket
import struct

import pytest

from ros import OPEN, Master, Program

pytestmark = pytest.mark.slow

PEAK = f"""{OPEN}
from pathlib import Path
def peak():  # [B] of this program; what getrusage tells includes the one that started it
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])
"""
LISTENER = f"""{PEAK}
import json
from catenary.crtk.transport import Rate
heard = transport.subscribe("/x", "sensor_msgs/JointState", largest=2048)
print(transport.node.uri)
sys.stdin.readline()
before = peak()
found = []
end = time.monotonic() + PATIENCE
while len(found) < 2 and time.monotonic() < end:
    found += [m.message.header.stamp for m in heard.take(0.1) if m.message.header.stamp not in found]
print(json.dumps([found, heard.oversized, peak() - before]))
sys.stdin.readline()
print("pid", transport.node.master.node_answers(transport.node.uri))
"""
TALKER = f"""{OPEN}
import struct
from patience import until
J = message_class("sensor_msgs/JointState")
publisher = transport.publisher("/x", "sensor_msgs/JointState")
until(lambda: publisher._peers)
publisher.publish(J(name=("",) * 1_000_000))  # 4 MB, as a message
publisher.publish(J(header(1)))
(peer,) = publisher._peers
until(lambda: not peer._rest and not peer._waiting)
sock = peer.connection.socket
sock.setblocking(True)
try:
    sock.sendall(struct.pack("<I", 2**31) + bytes(1000))
    for _ in range(2000):  # 200 MB, if anybody reads it
        sock.sendall(bytes(100_000))
except OSError:
    print("closed")
peer.connection.close()
while True:  # over a new connection
    publisher.publish(J(header(2)))
    time.sleep(0.05)
"""
CALLER = """
import http.client, sys
host, _, port = sys.argv[2].removeprefix("http://").strip("/").partition(":")
def post(head, body):
    connection = http.client.HTTPConnection(host, int(port), timeout=60.0)
    connection.putrequest("POST", "/")
    for name, value in head.items():
        connection.putheader(name, value)
    try:
        connection.endheaders()
        connection.send(body)
        return connection.getresponse().status
    except OSError:
        return 0
call = b"<methodCall><methodName>getPid</methodName><params>%s</params></methodCall>"
deep = b"<array><data><value>" * 3000
print(
    post({"Content-Length": "2000000000"}, bytes(100_000)),
    post({}, call % b""),
    post({"Content-Length": "-5"}, call % b""),
    post({"Content-Length": "9" * 5000}, call % b""),
    post({"Content-Length": "4"}, b"\\xff\\x00<>") in (200, 500),
    post({"Content-Length": str(len(call % deep) )}, call % deep) in (200, 500, 413),
)
"""


def test_a_peer_that_announces_gigabytes_costs_no_memory_and_no_other_message(ros_master: Master) -> None:
    with Program(ros_master, LISTENER, "listener") as listener:
        listener.line()
        listener.say("")
        with Program(ros_master, TALKER, "talker") as talker:
            assert talker.line() == "closed"
            stamps, oversized, memory = json.loads(listener.line())
    assert stamps == [1, 2]
    assert oversized == 2
    assert memory < 50e6


GREETED = f"""{PEAK}
from rospy.impl.tcpros_base import get_tcpros_server_address
publisher = transport.publisher("/x", "std_msgs/Empty")
before = peak()
print(get_tcpros_server_address()[1])
sys.stdin.readline()
print(peak() - before)
"""


def test_a_new_peer_that_announces_gigabytes_of_greeting_costs_no_memory(ros_master: Master) -> None:
    with Program(ros_master, GREETED, "greeted") as greeted:
        with socket.create_connection(("127.0.0.1", int(greeted.line())), 30.0) as peer:
            try:
                peer.sendall(struct.pack("<I", 2**31))
                for _ in range(2000):  # 200 MB, if anybody reads it
                    peer.sendall(bytes(100_000))
            except OSError:  # it was closed
                pass
        greeted.say("")
        assert int(greeted.line()) < 50e6


def test_calls_of_any_content_do_not_end_a_node(ros_master: Master) -> None:
    with Program(ros_master, LISTENER, "listener") as listener:
        uri = listener.line()
        with Program(ros_master, CALLER, "caller", uri) as caller:
            assert caller.line() in ("413 413 413 413 True True", "0 413 413 413 True True")
        listener.say("")
        with Program(ros_master, TALKER, "talker"):
            listener.line()
            listener.say("")
            assert listener.line() == "pid True"
