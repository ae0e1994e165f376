"""A stand-in for rclpy, within one process: the interface of rclpy (Humble) as far as a transport uses it.

It is as strict as the original where that matters: messages are bytes of their types (as Humble defines them),
qualities of service must be compatible, callbacks run only while an executor spins, histories keep the last `depth`
messages, and coroutines are run by the executor.
"""

import copy
import enum
import inspect
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import patch

from rosbags.typesys import Stores, get_typestore

from catenary.recording.messages import MESSAGES, SERVICES, fields, ros2_name

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)


DurabilityPolicy = enum.Enum("DurabilityPolicy", "TRANSIENT_LOCAL VOLATILE")
ReliabilityPolicy = enum.Enum("ReliabilityPolicy", "RELIABLE BEST_EFFORT")
HistoryPolicy = enum.Enum("HistoryPolicy", "KEEP_LAST KEEP_ALL")
SignalHandlerOptions = enum.Enum("SignalHandlerOptions", "NO ALL")


@dataclass(kw_only=True)
class QoSProfile:
    history: Any = HistoryPolicy.KEEP_LAST
    depth: int = 0
    reliability: Any = ReliabilityPolicy.RELIABLE
    durability: Any = DurabilityPolicy.VOLATILE


class Context:
    def __init__(self) -> None:
        self._running = False

    def ok(self) -> bool:
        return self._running


class Future:
    def __init__(self, *, executor: Any = None) -> None:
        self._done = False
        self._result: Any = None
        self._callbacks: list[Callable[[Any], None]] = []
        self._lock = threading.Lock()

    def done(self) -> bool:
        return self._done

    def result(self) -> Any:
        return self._result

    def set_result(self, result: Any) -> None:
        with self._lock:
            self._result, self._done = result, True
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)

    def add_done_callback(self, callback: Callable[[Any], None]) -> None:
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
        callback(self)

    def __await__(self) -> Iterator[None]:
        while not self._done:
            yield
        return self._result


class SingleThreadedExecutor:
    def __init__(self, *, context: Context) -> None:
        self._jobs: deque[Callable[[], Any]] = deque()
        self._tasks: list[Any] = []
        self._nodes: list[Node] = []
        self._changed = threading.Condition()

    def add_node(self, node: "Node") -> bool:
        self._nodes.append(node)
        node.executor = self
        return True

    def put(self, job: Callable[[], Any]) -> None:
        with self._changed:
            self._jobs.append(job)
            self._changed.notify_all()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        with self._changed:
            if not self._tasks:
                self._changed.wait_for(lambda: self._jobs, timeout_sec)
            job = self._jobs.popleft() if self._jobs else None
        if job is not None:
            result = job()
            if inspect.iscoroutine(result):
                self._tasks.append(result)
        for task in tuple(self._tasks):
            try:
                task.send(None)
            except StopIteration:
                self._tasks.remove(task)
        if self._tasks and job is None:
            time.sleep(0.001)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        for task in self._tasks:
            task.close()
        return True


class Publisher:
    def __init__(self, node: "Node", kind: Any, topic: str, qos: QoSProfile) -> None:
        self.node, self.kind, self.topic, self.qos = node, kind, topic, qos
        self.history: deque[bytes] = deque(maxlen=max(qos.depth, 1))

    def publish(self, message: bytes) -> None:
        if not isinstance(message, bytes):
            raise TypeError(f"Expected bytes, got {type(message)}")
        if self.kind.ros2_name in HUMBLE.fielddefs:
            HUMBLE.deserialize_cdr(message, self.kind.ros2_name)
        with GRAPH.lock:
            if self.qos.durability is DurabilityPolicy.TRANSIENT_LOCAL:
                self.history.append(message)
            for subscription in GRAPH.subscriptions:
                if subscription.matches(self):
                    subscription.deliver(message)


class Subscription:
    def __init__(self, node: "Node", kind: Any, topic: str, callback: Any, qos: QoSProfile) -> None:
        self.node, self.kind, self.topic, self.callback, self.qos = node, kind, topic, callback, qos
        self._history: deque[bytes] = deque(maxlen=max(qos.depth, 1))

    def matches(self, publisher: Publisher) -> bool:
        asks_more = (
            self.qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
            and publisher.qos.durability is DurabilityPolicy.VOLATILE
        )
        return self.topic == publisher.topic and self.kind is publisher.kind and not asks_more

    def deliver(self, message: bytes) -> None:
        self._history.append(message)
        self.node.executor.put(self._take)

    def _take(self) -> None:
        with GRAPH.lock:
            message = self._history.popleft() if self._history and self in GRAPH.subscriptions else None
        if message is not None:
            self.callback(message)


@dataclass(frozen=True)
class Service:
    node: "Node"
    kind: Any
    name: str
    callback: Any


@dataclass(frozen=True)
class Client:
    node: "Node"
    kind: Any
    name: str

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        end = time.monotonic() + (timeout_sec or 0.0)
        while not (found := self.name in {one.name for one in GRAPH.services}) and time.monotonic() < end:
            time.sleep(0.01)
        return found

    def call_async(self, request: Any) -> Future:
        assert isinstance(request, self.kind.Request)
        future = Future()
        service = next(one for one in GRAPH.services if one.name == self.name)

        async def answer() -> None:
            result = service.callback(copy.deepcopy(request), self.kind.Response())
            if inspect.iscoroutine(result):
                result = await result
            assert isinstance(result, self.kind.Response)
            self.node.executor.put(lambda: future.set_result(result))

        service.node.executor.put(answer)
        return future


class Node:
    def __init__(self, name: str, *, context: Context, use_global_arguments: bool = True) -> None:
        assert context.ok(), "rclpy.init() has not been called"
        self.name, self.executor = name, SingleThreadedExecutor(context=context)

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile) -> Publisher:
        made = Publisher(self, msg_type, topic, qos_profile)
        with GRAPH.lock:
            GRAPH.publishers.append(made)
        return made

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, qos_profile: QoSProfile, *, raw: bool = False
    ) -> Subscription:
        assert raw, "this stand-in knows bytes only"
        made = Subscription(self, msg_type, topic, callback, qos_profile)
        with GRAPH.lock:
            GRAPH.subscriptions.append(made)
            for publisher in GRAPH.publishers:
                if made.matches(publisher) and qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL:
                    for message in publisher.history:
                        made.deliver(message)
        return made

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Service:
        GRAPH.services.append(Service(self, srv_type, srv_name, callback))
        return GRAPH.services[-1]

    def create_client(self, srv_type: Any, srv_name: str) -> Client:
        return Client(self, srv_type, srv_name)

    def destroy_publisher(self, publisher: Publisher) -> bool:
        with GRAPH.lock:
            GRAPH.publishers.remove(publisher)
        return True

    def destroy_subscription(self, subscription: Subscription) -> bool:
        with GRAPH.lock:
            GRAPH.subscriptions.remove(subscription)
        return True

    def destroy_client(self, client: Client) -> bool:
        return True

    def destroy_node(self) -> None:
        with GRAPH.lock:
            for kind in (GRAPH.publishers, GRAPH.subscriptions, GRAPH.services):
                kind[:] = [one for one in kind if one.node is not self]

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        ends: list[Any] = [*GRAPH.publishers, *GRAPH.subscriptions]
        return [
            (topic, sorted({one.kind.ros2_name for one in ends if one.topic == topic}))
            for topic in {one.topic for one in ends}
        ]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(one.name, [one.kind.__name__]) for one in GRAPH.services]

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return [_info(one) for one in GRAPH.publishers if one.topic == topic]

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Any]:
        return [_info(one) for one in GRAPH.subscriptions if one.topic == topic]

    def count_publishers(self, topic: str) -> int:
        return sum(one.topic == topic for one in GRAPH.publishers)


GRAPH = SimpleNamespace(lock=threading.RLock(), publishers=[], subscriptions=[], services=[])


def _info(end: Any) -> SimpleNamespace:
    return SimpleNamespace(node_name=end.node.name, node_namespace="/", qos_profile=end.qos)


def init(*, args: Any, context: Context, signal_handler_options: SignalHandlerOptions) -> None:
    assert signal_handler_options is SignalHandlerOptions.NO
    context._running = True


def shutdown(*, context: Context) -> None:
    assert context.ok(), "rclpy.shutdown() was called already"
    context._running = False


def _half_of_service(name: str) -> Any:
    """A request's or response's class, whose setters check types as rosidl's generated Python does."""
    kinds = {field.name: {"bool": bool, "string": str}.get(field.type, object) for field in fields(name)}

    def __init__(self: Any) -> None:
        for key, kind in kinds.items():
            setattr(self, key, kind())

    def __setattr__(self: Any, key: str, value: Any) -> None:
        if key not in kinds:
            raise AttributeError(f"'{name}' object has no attribute '{key}'")
        assert isinstance(value, kinds[key]), f"The '{key}' field must be of type '{kinds[key].__name__}'"
        object.__setattr__(self, key, value)

    return type(name.rpartition("/")[2], (), {"__init__": __init__, "__setattr__": __setattr__})


@contextmanager
def installed() -> Iterator[None]:
    """Put it, and the messages that ROS 2 has, where `import` finds them."""
    qos = {kind.__name__: kind for kind in (QoSProfile, DurabilityPolicy, ReliabilityPolicy, HistoryPolicy)}
    modules: dict[str, dict[str, Any]] = {
        "rclpy": {"init": init, "create_node": Node, "shutdown": shutdown},
        "rclpy.context": {"Context": Context},
        "rclpy.executors": {"SingleThreadedExecutor": SingleThreadedExecutor},
        "rclpy.signals": {"SignalHandlerOptions": SignalHandlerOptions},
        "rclpy.task": {"Future": Future},
        "rclpy.qos": qos,
    }
    for name in MESSAGES:
        package, _, short = name.partition("/")
        if package != "raven_2":
            modules.setdefault(f"{package}.msg", {})[short] = type(short, (), {"ros2_name": ros2_name(name)})
    for name in SERVICES:
        package, _, short = name.partition("/")
        halves = {half: _half_of_service(f"{name}{half}") for half in ("Request", "Response")}
        modules.setdefault(f"{package}.srv", {})[short] = type(short, (), halves)
    made = {name: ModuleType(name) for name in (*modules, *(name.partition(".")[0] for name in modules))}
    for name, module in made.items():
        module.__dict__.update(modules.get(name, {}), __path__=[])
    with patch.dict(sys.modules, made):
        yield
