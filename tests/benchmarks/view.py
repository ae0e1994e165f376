"""What the view costs: processor time of its page, ticks of a 1 kHz loop with and without it beside, a first picture.

The browsers here are connections that read what the page sends, and one that hardly reads; how fast a browser draws is
its own affair. Each case runs as long, in turn, several times: other programs disturb all of them alike.
"""

import multiprocessing
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from catenary.control.loop import Tick, run_loop
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.view.page_process import PageProcess
from catenary.view.shapes import arm_shapes
from catenary.view.shown import Shown
from catenary.view.state import ViewState, unknown_state
from catenary.workflows.gravity.controllers import make_controller
from catenary.workflows.gravity.simulated_arm import SimulatedArm, simulated_arm
from catenary.workflows.gravity.trials import with_approach
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.programs import cpu_seconds

sys.path.insert(0, str(Path(__file__).parents[1]))

from view.connected import CAMERA, connect

CASES = {"no view": None, "no browser": 0, "one browser": 1, "ten browsers": 10, "one slow browser": -1}
BLUE = 0.02  # share of the picture that the reported arm fills
EVERY = 40  # ticks between two states


def read_pages(url: str, count: int, slow: bool, received: Any) -> None:
    """Connect as browsers do, and read until this process is ended; `received` counts bytes."""
    import msgspec

    clients = [connect(url) for _ in range(count)]
    for client in clients:
        client.send(msgspec.msgpack.encode(CAMERA))
    while True:
        for client in clients:
            try:
                received.value += len(client.recv(timeout=0.01))
                if slow:
                    time.sleep(2.0)
            except TimeoutError:
                pass


def state_of(tick: Tick, arm: SimulatedArm) -> ViewState:
    """All three arms, so that as much is drawn as can be."""
    q = tick.state.q
    return unknown_state(len(q))._replace(
        time=tick.time, q=q, true=arm.q_true(), calibrated=q + 0.01, interval=np.full(len(q), 0.01),
        inside=np.ones(len(q)), setpoint=tick.reference.q, tau=q if tick.tau is None else tick.tau, gravity_tau=q,
        feedback=q, gravity=tick.state.gravity, assumed=LEVEL, actual=tick.state.gravity, gravity_age=0.003, rate=1.0,
        mode="ENABLED, homed: random motion",
    )  # fmt: skip


@contextmanager
def beside(browsers: int | None, received: Any) -> Iterator[PageProcess | None]:
    """A page with so many browsers; None for none at all, -1 for a slow one."""
    if browsers is None:
        yield None
        return
    model = load_robot("raven2")
    legend = {"reported": "reported", "calibrated": "calibrated", "true": "true"}
    with PageProcess(port=18200) as page:
        url = page.open(Shown("benchmark", model, arm_shapes(model), legend=legend))
        context = multiprocessing.get_context("spawn")
        reader = context.Process(target=read_pages, args=(url, abs(browsers), browsers < 0, received), daemon=True)
        if browsers:
            reader.start()
            while not received.value and reader.is_alive():
                time.sleep(0.1)
            time.sleep(4.0)
        try:
            yield page
        finally:
            if browsers:
                reader.kill()
                reader.join()


def measure(browsers: int | None, seconds: float) -> dict[str, float]:
    """Run a 1 kHz loop in real time, with a page beside it or without."""
    arm = simulated_arm("raven2")
    controller = make_controller("dg", arm)
    motion, _ = with_approach(arm, random_sinusoids(np.random.default_rng(0), 60.0), 0.0)
    received = multiprocessing.get_context("spawn").Value("q", 0)
    with beside(browsers, received) as page:
        puts: list[float] = []

        def observe(tick: Tick) -> None:
            if page is not None and tick.number % EVERY == 0:
                state = state_of(tick, arm)
                begin = time.perf_counter()
                page.put(state)
                puts.append(time.perf_counter() - begin)

        before, received.value = 0.0 if page is None else cpu_seconds(page._process.pid), 0
        begin = time.perf_counter()
        ran = run_loop(
            arm.plant, controller, motion, limits=arm.limits(), observers=[observe], duration=seconds, real_time=True
        )
        took, read = time.perf_counter() - begin, received.value
        share = np.nan if page is None else (cpu_seconds(page._process.pid) - before) / took
    return {
        "overruns": ran.overruns,
        "ticks": ran.ticks,
        "compute_p999_us": np.nan if ran.compute is None else ran.compute.in_us()["p999"],
        "put_us": float(np.median(puts)) * 1e6 if puts else np.nan,
        "of_a_core": share,
        "kB_a_second_each": read / took / 1e3 / max(1, abs(browsers or 0)),
    }


def first_picture(robot: str) -> dict[str, float]:
    """Return seconds from `catenary view ROBOT` to its address, to the page's words and to the arm.

    A browser is open already, as somebody's is, and goes to the address as soon as the command says it. Chromium draws by
    software here, which takes seconds where a graphics card takes a part of one.
    """
    from view.browser import PATIENCE, looked_at_empty, share_of_pixels
    from view.command import view

    with looked_at_empty() as looked:
        begin = time.monotonic()
        with view(robot) as url:
            seconds = {"address": time.monotonic() - begin}
            looked.page.goto(url, wait_until="commit", timeout=PATIENCE)
            looked.wait_for_words()
            seconds["words"] = time.monotonic() - begin
            while share_of_pixels(looked.picture(), more=2, than=(0, 1)) < BLUE:
                pass
            seconds["arm"] = time.monotonic() - begin
    return seconds


def tables(seconds: float, rounds: int, what: tuple[str, ...], robot: str) -> Tables:
    """Measure a loop beside every number of browsers, and the time to a first picture."""
    found: Tables = {}
    if "loop" in what:
        runs: dict[str, list[dict[str, float]]] = {name: [] for name in CASES}
        for _ in range(rounds):
            for name, browsers in CASES.items():
                runs[name].append(measure(browsers, seconds))
        found["beside the loop, medians"] = {
            name: {key: float(np.median([run[key] for run in own])) for key in own[0]} for name, own in runs.items()
        }
    if "picture" in what:
        found["a first picture, s"] = {f"round {number + 1}": first_picture(robot) for number in range(rounds)}
    return found


if __name__ == "__main__":
    report(tables, __doc__, seconds=20.0, rounds=3, what=("loop", "picture"), robot="raven2")
