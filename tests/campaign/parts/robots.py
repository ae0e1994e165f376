"""What may move a robot wrongly, or run code: spoilt torques and references in a control loop, robot files of xacro.

Held is what docs/safety.md says: whatever a controller returns and a trajectory asks, a loop ends by itself or with an
error of the package that leaves the robot paused; no joint goes on beyond its speed, no reference that leaps is sent,
and nothing is compiled in mid-motion. No reader expands xacro unasked.
"""

import random
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.campaign.part import Fell, Part

FALL_S = 0.02  # a joint may be too fast for so long: half of the guard's window, and a few ticks
SECONDS = 1.0
SPOILT: dict[str, Callable[[Any], Any]] = {
    "none": lambda tau: tau,
    "list": lambda tau: tau.tolist(),
    "float32": lambda tau: tau.astype(np.float32),
    "int": lambda tau: tau.astype(int),
    "column": lambda tau: tau[:, None],
    "scalar": lambda tau: float(tau[0]),
    "nothing": lambda tau: None,
    "complex": lambda tau: tau + 1j,
    "text": lambda tau: [str(each) for each in tau],
    "nan": lambda tau: np.full_like(tau, np.nan),
    "push": lambda tau: tau + 200.0,
}


def loop(seed: int, folder: Path) -> None:
    """Run a controller on a rigid arm with an unknown load; some torques and one setpoint are spoilt."""
    from numba.core import event

    from catenary.control.controllers import CONTROLLERS, HOLDS
    from catenary.control.loop import Tick, run_loop
    from catenary.control.shutdown import MAX_STEP
    from catenary.errors import CatenaryError
    from catenary.trajectories.reference import Reference
    from catenary.workflows.gravity_trials import simulated_arm

    rng = random.Random(seed)
    arm = simulated_arm(rng.choice(["raven2", "ur5e", "panda"]), payload=rng.choice([0.0, 2.0, 8.0]))
    plant, n = arm.plant, arm.model.n
    start = plant.measured_js().q
    hold = rng.random() < 0.4
    kinds = [kind for kind in (HOLDS if hold else CONTROLLERS).values() if kind.fits(arm)]
    kind = rng.choice(kinds)
    controller = kind.make(arm)
    how, share = rng.choice(list(SPOILT)), rng.choice([0.002, 0.05, 0.5, 1.0])
    leap_at, leap = rng.choice([np.inf, rng.uniform(0.1, 0.9)]), rng.uniform(-1.0, 1.0)
    (folder / "input").write_text(f"{arm.model.name} {kind} {how} {share} {leap_at} {leap}")
    seen: list[Tick] = []
    compiled: list[object] = []

    class Spoilt:
        def torque(self, state: Any, reference: Any) -> Any:
            tau = controller.torque(state, reference)
            return SPOILT[how](tau) if rng.random() < share else tau

    class Moving:
        duration = SECONDS

        def __call__(self, time: float) -> Reference:
            rate, away = 2.0, 0.02
            moved = away * (1.0 - np.cos(rate * time)) + (leap if time >= leap_at else 0.0)
            speed = np.full(n, away * rate * np.sin(rate * time))
            return Reference(start + moved, speed, np.full(n, away * rate**2 * np.cos(rate * time)))

    def observe(tick: Tick) -> None:
        if not seen:
            event.register("numba:compile", listener)
        seen.append(tick)

    listener = event.RecordingListener()
    why = ""
    try:
        run_loop(plant, Spoilt(), Moving(), observers=[observe])
    except CatenaryError as error:
        why = str(error)
    finally:
        if seen:
            event.unregister("numba:compile", listener)
            compiled = listener.buffer
    if compiled:
        raise Fell(f"compiled in mid-motion: {compiled[:2]}")
    if why and plant.operating_state().state not in ("PAUSED", "DISABLED"):
        raise Fell(f"{plant.operating_state()} after {why}")
    _hold_speeds(
        seen,
        np.asarray(getattr(plant, "velocity_limit", np.zeros(n))),
        np.array([MAX_STEP[each] for each in plant.joint_units]),
        why,
    )


def _hold_speeds(seen: list[Any], stated: Any, leap: Any, why: str) -> None:
    """Refuse ticks in which a joint stays too fast, or which follow a reference that leapt."""
    if len(seen) < 2:
        return
    most = np.where(np.isfinite(stated) & (stated > 0.0), 1.2 * stated, 2.0)
    q, time = np.array([tick.q_nominal for tick in seen]), np.array([tick.state.time for tick in seen])
    speed = np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None]
    long = round(2.0 * FALL_S / 1e-3)
    if len(speed) > long:
        mean = np.lib.stride_tricks.sliding_window_view(speed, long, axis=0).min(axis=2)
        if (mean > most).any():
            raise Fell(f"a joint at {mean.max():.3g} rad/s for {2e3 * FALL_S:.0f} ms went on; {why or 'finished'}")
    steps = np.abs(np.diff([tick.reference.q for tick in seen], axis=0))
    if (steps > most * 1e-3 + leap + 1e-9).any():
        raise Fell(f"a reference leapt by {steps.max():.3g}; {why or 'finished'}")


def xacro(seed: int, folder: Path) -> None:
    """Name a xacro file to a reader in some way; the code in it must not run."""
    from catenary.errors import CatenaryError
    from catenary.robots.catalog import load_robot
    from catenary.robots.urdf import load_urdf
    from command_line import catenary

    rng = random.Random(seed)
    ran: list[str] = []
    sys.modules["xacro"] = SimpleNamespace(process_file=lambda name: ran.append(name))  # type: ignore[assignment]
    code = f"${{().__class__.__base__.__subclasses__()[{rng.randrange(500)}]}}"
    body = rng.choice(
        [
            f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="{code}"><link name="a"/></robot>',
            f'<robot xmlns:x="http://wiki.ros.org/xacro"><x:property name="a" value="{code}"/></robot>',
            f'<robot name="a"><link name="{code}"/></robot>',
            '<robot name="a"><link name="a"/></robot>',
        ]
    )
    path = folder / rng.choice(["arm.urdf.xacro", "arm.xacro", "arm.URDF.XACRO", "arm.urdf", "arm.xml"])
    path.write_text(body, "utf-8")
    if rng.random() < 0.3:
        table = folder / "arm.toml"
        table.write_text(f'description = "{path.name}"\n', "utf-8")
        path = table
    elif rng.random() < 0.2:
        link = folder / "linked.urdf"
        link.symlink_to(path.name)
        path = link
    reader = rng.choice(
        ["load_robot", "load_urdf", "check", "gravity", "fk", "plot", "regressor", "excitation", "view"]
    )
    try:
        if reader in ("load_robot", "load_urdf"):
            {"load_robot": load_robot, "load_urdf": load_urdf}[reader](path)
        elif reader == "check":
            catenary("check", path)
        else:
            catenary(reader, path, *(["--q", "0"] if reader in ("gravity", "fk") else []))
    except CatenaryError:
        pass
    if ran:
        raise Fell(f"{reader} expanded {path.name}")


PARTS = (
    Part("robots.loop", 300, loop, processor_time=60.0, memory=3 * 10**9, warnings_fail=False),
    Part("robots.xacro", 300, xacro, processor_time=30.0, may_refuse=True, memory=3 * 10**9, warnings_fail=False),
)
