"""Two robots of one name: one served in simulated time beside others that come and go; two `serve` that begin at once.

Held is what docs/crtk.md says: while another publishes its joints, a served arm is not ENABLED for longer than the next
look; once it is gone, the arm can be enabled again. Of two that are started one serves at most, and one that was
killed keeps the next one out no longer than its entry lives.
"""

import functools
import random
import time
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

from tests.campaign.part import PROGRAMS, Fell, Part
from tests.campaign.parts.stalls import ros1_is_installed

LOOK = 0.11  # [s] until a served robot has looked who else is there


def simulated(seed: int, folder: Path) -> None:
    """Let rivals come and go beside a served robot, which is told to do all kinds of things meanwhile."""
    from catenary.crtk.loopback import Loopback
    from served_robot import ServedRobot, shoulder

    rng = random.Random(seed)
    dialect = "raven" if seed % 2 else "crtk"
    robot = ServedRobot(dialect)  # type: ignore[arg-type]
    there: dict[str, Loopback] = {}
    since = 0.0
    for step in range(12):
        if rng.random() < 0.3 and len(there) < 2:
            since = since if there else robot.clock.now() / 1e9
            name = f"rival{step}"
            there[name] = Loopback(name, robot.network)
            topic = robot.name("measured_js", rng.choice(["gold", "green"]))  # type: ignore[arg-type]
            there[name].publisher(topic, "sensor_msgs/JointState")
        elif rng.random() < 0.3 and there:
            there.pop(rng.choice(sorted(there))).close()
        for _ in range(rng.randrange(1, 60)):
            robot.tick(rng.randrange(1, 8))
            if rng.random() < 0.3:
                robot.command(rng.choice(["enable", "resume", "home", "pause", "disable"]))
            elif rng.random() < 0.3:
                robot.joints("servo_jr", shoulder(1e-4))
            elif rng.random() < 0.05:
                robot.server.press_button()
            beside = robot.clock.now() / 1e9 - since
            if there and beside > LOOK and robot.state() == "ENABLED":
                raise Fell(f"{dialect}: ENABLED for {beside:.3f} s beside {sorted(there)}")
    for rival in there.values():
        rival.close()
    robot.tick(200)
    robot.command("pause")
    robot.tick(5)
    if robot.state() == "DISABLED":
        robot.server.press_button() if dialect == "raven" else robot.command("enable")
        robot.tick(5)
    robot.command("resume")
    robot.tick(5)
    if robot.state() != "ENABLED":
        raise Fell(f"{dialect}: {robot.state()} after all have gone")


def programs(ros: str, seed: int, folder: Path) -> None:
    """Start two that serve, at once or one after the other; then kill one that serves, and start another."""
    from dds import Network
    from ros import COMMAND, Program, running_master

    rng = random.Random(seed)
    serve = ["serve", "--ros", ros, "--homed", "--json", "--name"]
    with ExitStack() as stack:
        network = stack.enter_context(running_master(folder)) if ros == "1" else Network()
        names = ["one", "other"] if ros == "1" else ["one", "one"]
        both = []
        for name in names:
            both.append(stack.enter_context(Program(network, COMMAND, *serve, name, "--duration", "8")))
            time.sleep(rng.choice([0.0, 0.1, 1.0, 5.0]) * rng.random())
        ends = [(program.process.wait(120.0), program.finish()[1]) for program in both]
        if [code for code, _ in ends].count(0) > 1:
            raise Fell("both served")
        for code, errors in ends:
            if code and not (code == 2 and "two robots of one name" in errors and "Traceback" not in errors):
                raise Fell(f"exit {code}: {errors[-1000:]}")
        killed = stack.enter_context(Program(network, COMMAND, *serve, "one"))
        killed.line()  # it serves
        killed.process.kill()
        killed.process.wait()
        begin = time.monotonic()
        after = stack.enter_context(Program(network, COMMAND, *serve, names[1], "--duration", "2"))
        after.line()
        if time.monotonic() - begin > 60.0:
            raise Fell(f"kept out for {time.monotonic() - begin:.0f} s")


PARTS = (
    Part("rivals.simulated", 200, simulated, processor_time=60.0),
    *([Part("rivals.ros1", 12, functools.partial(programs, "1"), **PROGRAMS)] if ros1_is_installed() else []),
    *([Part("rivals.ros2", 12, functools.partial(programs, "2"), **PROGRAMS)] if find_spec("cyclonedds") else []),
)
