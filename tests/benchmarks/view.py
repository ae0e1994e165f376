"""What the view costs: ticks of a 1 kHz loop with and without it beside, a state put on its page, a first picture."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from catenary.control.loop import Tick, run_loop
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.view.page_process import PageProcess
from catenary.view.shapes import arm_shapes
from catenary.view.shown import Shown
from catenary.view.state import ViewState, unknown_state
from catenary.workflows.gravity.simulated_arm import SimulatedArm, simulated_arm
from catenary.workflows.gravity.trials import make_controller, with_approach
from tests.benchmarks.measure import Tables, report

sys.path.insert(0, str(Path(__file__).parents[1]))

BLUE = 0.02  # share of the picture that the reported arm fills
EVERY = 40  # ticks between two states


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
def page_beside() -> Iterator[PageProcess]:
    """A page that nobody looks at: who puts states does not know."""
    model = load_robot("raven2")
    legend = {"reported": "reported", "calibrated": "calibrated", "true": "true"}
    with PageProcess(port=18200) as page:
        page.open(Shown("benchmark", model, arm_shapes(model), legend=legend))
        yield page


def measure(page: PageProcess | None, seconds: float) -> dict[str, float]:
    """Run a 1 kHz loop in real time, with a page beside it or without."""
    arm = simulated_arm("raven2")
    motion, _ = with_approach(arm, random_sinusoids(np.random.default_rng(0), 60.0), 0.0)
    puts: list[float] = []

    def observe(tick: Tick) -> None:
        if page is not None and tick.number % EVERY == 0:
            state = state_of(tick, arm)
            begin = time.perf_counter()
            page.put(state)
            puts.append(time.perf_counter() - begin)

    ran = run_loop(
        arm.plant, make_controller("dg", arm), motion, limits=arm.limits(), observers=[observe], duration=seconds,
        real_time=True,
    )  # fmt: skip
    return {
        "overruns": ran.overruns,
        "ticks": ran.ticks,
        "compute_p999_us": np.nan if ran.compute is None else ran.compute.in_us()["p999"],
        "put_us": float(np.median(puts)) * 1e6 if puts else np.nan,
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


def tables(seconds: float, rounds: int, robot: str) -> Tables:
    """Measure a loop beside a page and without one, in turn, and the time to a first picture."""
    runs: dict[str, list[dict[str, float]]] = {"no view": [], "a view": []}
    for _ in range(rounds):
        runs["no view"].append(measure(None, seconds))
        with page_beside() as page:
            runs["a view"].append(measure(page, seconds))
    return {
        "beside the loop, medians": {
            name: {key: float(np.median([run[key] for run in own])) for key in own[0]} for name, own in runs.items()
        },
        "a first picture, s": {f"round {number + 1}": first_picture(robot) for number in range(rounds)},
    }


if __name__ == "__main__":
    report(tables, __doc__, seconds=20.0, rounds=3, robot="raven2")
