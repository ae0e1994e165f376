"""A robot at rest after a motion, however that ends: it holds, then it is paused."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np

from catenary.control.shutdown import attempt
from catenary.errors import CatenaryError, TransportError
from catenary.plant import Plant

HOLD_TICKS = 20  # during which a robot is told to stay where it is


@contextmanager
def at_rest_afterwards(plant: Plant, began: Callable[[], bool] = lambda: True) -> Iterator[None]:
    """Pause a robot when what runs inside ends; where an error, Ctrl-C or a signal ends it, hold it first.

    A second Ctrl-C does not keep it from being paused. What fails on the way is told with the error.

    Args:
        plant: Enabled and homed.
        began: Whether anything has moved; one of our errors before that is a refusal, and changes no state.
    """
    try:
        yield
        pause(plant)
    except BaseException as error:
        if began() or not isinstance(error, CatenaryError):
            attempt(error, holding=lambda: hold(plant), pausing=lambda: pause(plant))
        raise


@contextmanager
def paused_if_interrupted(plant: Plant) -> Iterator[None]:
    """Pause a robot when Ctrl-C or a signal ends what runs inside, as while a person is asked for something."""
    try:
        yield
    except KeyboardInterrupt as stop:
        attempt(stop, pausing=lambda: pause(plant))
        raise


def hold(plant: Plant) -> None:
    """Hold a robot at its setpoint; one that is not enabled stands on its brakes and is left alone."""
    q = np.array(plant.setpoint_js().q)
    for _ in range(HOLD_TICKS):
        if plant.operating_state().state != "ENABLED":
            return
        plant.servo_jp(q)
        plant.wait()


def pause(plant: Plant) -> None:
    """Pause a robot that is enabled, or silent: one that only stood still obeys when it goes on."""
    with suppress(TransportError):
        if plant.operating_state().state != "ENABLED":
            return
    plant.state_command("pause")
