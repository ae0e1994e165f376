"""What the view costs: processor time of its page, and ticks of a 1 kHz loop with and without it beside.

The browsers here are connections that read what the page sends, and one that hardly reads; how fast a browser draws is
its own affair. Each case runs as long, in turn, several times: other programs disturb all of them alike.
"""

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from catenary.control.loop import Tick, run_loop
from catenary.files import json_text
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

sys.path.insert(0, str(Path(__file__).parents[1]))

from view.connected import CAMERA, connect

CASES = {"no view": None, "no browser": 0, "one browser": 1, "ten browsers": 10, "one slow browser": -1}
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


def processor_time(pid: int) -> float:
    """Processor time that a process has taken [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


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
        reader = context.Process(
            target=read_pages, args=(url, abs(browsers), browsers < 0, received), daemon=True
        )
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


def measure(browsers: int | None, seconds: float) -> dict[str, Any]:
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

        before, received.value = 0.0 if page is None else processor_time(page.pid), 0
        begin = time.perf_counter()
        report = run_loop(
            arm.plant,
            controller,
            motion,
            limits=arm.limits(),
            observers=[observe],
            duration=seconds,
            real_time=True,
        )
        took, read = time.perf_counter() - begin, received.value
        share = None if page is None else (processor_time(page.pid) - before) / took
    compute = report.compute
    return {
        "overruns": report.overruns,
        "ticks": report.ticks,
        "compute_us": None if compute is None else compute.in_us(),
        "put_us": float(np.median(puts)) * 1e6 if puts else None,
        "share_of_a_core": share,
        "kilobytes_a_second": read / took / 1e3 / max(1, abs(browsers or 0)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in CASES}
    for _ in range(options.rounds):
        for name, browsers in CASES.items():
            found[name].append(measure(browsers, options.seconds))
    print(
        f"{'beside the loop':18} {'overruns of ticks':>24} {'compute p99.9 us':>18} {'put us':>8} {'of a core':>10} {'kB/s each':>10}"
    )
    for name, runs in found.items():
        overruns, ticks = sum(run["overruns"] for run in runs), sum(run["ticks"] for run in runs)
        slowest = np.median([run["compute_us"]["p999"] for run in runs])
        put = np.median([run["put_us"] or np.nan for run in runs])
        share = np.median(
            [np.nan if run["share_of_a_core"] is None else run["share_of_a_core"] for run in runs]
        )
        read = np.median([run["kilobytes_a_second"] for run in runs])
        print(
            f"{name:18} {overruns:>12} of {ticks:>8} {slowest:>18.0f} {put:>8.0f} {share:>10.2f} {read:>10.0f}"
        )
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json_text(found))


if __name__ == "__main__":
    main()
