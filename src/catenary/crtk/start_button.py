"""Press a RAVEN-II's silver button, by its topic, which every network carries."""

from catenary.crtk.message import message_class
from catenary.crtk.topic_names import BUTTON, NAMESPACES, SIGNAL, TEXT, WARNING
from catenary.crtk.transport import Transport
from catenary.errors import TransportError

STARTS = ": starts"  # what the robot says of an arm that the button starts
SAID = "button: "  # before it, where it says so on a topic


def press_button(transport: Transport, timeout: float = 5.0) -> tuple[bool, str]:
    """Press it; return whether an arm starts, and what the robot says within `timeout` [s], or raise TransportError."""
    publisher = transport.publisher(BUTTON, SIGNAL)
    heard = transport.subscribe(f"{NAMESPACES['gold']}/{WARNING}", TEXT)
    try:
        for _ in range(100):  # a second
            there = transport.connections(publisher.topic).subscribers, transport.connections(heard.topic).publishers
            if all(there):
                break
            transport.sleep(0.01)
        else:
            raise TransportError(f"{BUTTON}: nobody listens to it")
        publisher.publish(message_class(SIGNAL)())
        for _ in range(round(timeout / 0.01)):
            for message, _ in heard.take():
                if message.data.startswith(SAID):
                    return message.data.endswith(STARTS) or f"{STARTS};" in message.data, message.data[len(SAID) :]
            transport.sleep(0.01)
    finally:
        heard.close()
        publisher.close()
    raise TransportError(f"{BUTTON}: no answer within {timeout:g} s")
