"""catenary view: an arm in the browser, reported, calibrated and true; a simulated one is driven from there."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from catenary.cli.options import robots_beginning
from catenary.cli.terminal import announce, print_json_line
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.view.page_process import PageProcess
    from catenary.view.shown import Shown

HERE = "127.0.0.1"


def view(
    what: Annotated[
        str,
        Argument(
            metavar="[ROBOT | PROJECT]",
            help="raven2, another robot of the catalogue, a robot file, or the folder of a project.",
            autocompletion=robots_beginning,
        ),
    ] = "raven2",
    model: Annotated[
        Path | None,
        Option(metavar="MODEL", help="Calibration model: the calibrated arm beside the reported one."),
    ] = None,
    port: Annotated[int, Option(help="Of 127.0.0.1; the next free one where it is taken.")] = 8080,
    host: Annotated[
        str, Option(help="127.0.0.1 alone; from another machine forward the port over SSH.")
    ] = HERE,
    robot_seed: Annotated[
        int | None, Option(help="Another RAVEN-II, drawn with this seed. [default: the nominal one]")
    ] = None,
    seconds: Annotated[float | None, Option(help="How long. [default: until Ctrl-C]")] = None,
    as_json: Annotated[
        bool, Option("--json", help="Print the address of the page as a line of JSON.")
    ] = False,
) -> None:
    """Show an arm in the browser.

    A simulated arm moves at once, and is driven from the page: motion, controller, base, payload, sensor's faults,
    friction and wear. Beside the reported arm stands the true one, and with a model the calibrated one.

    Example: catenary view raven2
    """
    from catenary.view.page_process import PageProcess

    if host != HERE:
        raise InputError(_elsewhere(host, port))
    with PageProcess(port=port) as page:
        announce("preparing the robot ...")
        end = float("inf") if seconds is None else time.monotonic() + seconds
        try:
            import numpy as np

            from catenary.view.simulated import DrivenArm

            driven = DrivenArm(what, model=model, seed=robot_seed, rng=np.random.default_rng(0))
            _open(page, driven.shown(f"catenary: {what}"), what, as_json=as_json)
            driven.run(page, lambda: time.monotonic() > end)
        except KeyboardInterrupt:
            pass  # the usual end


def _open(page: "PageProcess", shown: "Shown", what: str, *, as_json: bool) -> None:
    """Open the page and say where it is."""
    url = page.open(shown)
    if as_json:
        print_json_line({"shown": what, "url": url})
    else:
        print(f"{what}: {url} (Ctrl-C ends it)", flush=True)


def _elsewhere(host: str, port: int) -> str:
    from socket import gethostname

    return (
        f'--host "{host}": expected {HERE}: whoever reaches the page can drive the arm, and it asks for no password. '
        f"From another machine: ssh -L {port}:{HERE}:{port} {gethostname()}, then open http://{HERE}:{port} there"
    )
