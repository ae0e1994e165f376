"""One tick of one arm as Python calls it: machine code that knows where the arm's numbers lie.

numba looks at every array of a call; with thirteen of them that takes as long as the physics of a tick, and several
times as long where the arrays have left the processor's caches since the last tick, as they have in real time.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.array_layout import ArrayKind
from catenary.kernels.compiled import address_of, array_at
from catenary.kernels.llvm_calls import call_with, refusing
from catenary.simulation.packed import ARM, CABLE, CONTROL, CONTROL_WHOLE, FIRMWARE, LOG, TREE
from catenary.simulation.ticks import run_ticks

_KINDS = tuple(ArrayKind("float64", shape, writable=False) for shape in ((7,), (1, 3), (1, 3, 3)))
_POINTERS = ("int64", "bool", *["float64"] * 5, "int64", "int64", *["float64"] * len(_KINDS))
TickCall = Callable[[Floats, Floats, Floats], None]
Whole = NDArray[np.int64]
# the first arguments of `run_ticks`: parent, prismatic, tree, cable, firmware, the arm's state, the control's two
TickArrays = tuple[Whole, NDArray[np.bool_], Floats, Floats, Floats, Floats, Floats, Whole]


def tick_call(given: TickArrays, substeps: int) -> TickCall:
    """Give `call(setpoint (7,), gravity (1, 3), base motion (1, 3, 3))`: `run_ticks` of one tick, without a log.

    Any other arrays raise InputError, and nothing has happened.

    Args:
        given: Kept, and written to in every tick.
        substeps: Physics steps in a tick.
    """
    return call_with(
        _address(), (*given, np.array([substeps])), _KINDS, refusing("a tick: other arrays than expected")
    )


@cache
def _address() -> int:
    return address_of(_tick_at, *_POINTERS)


def _tick_at(
    parent: Any,
    prismatic: Any,
    tree: Any,
    cable: Any,
    firmware: Any,
    arm: Any,
    control: Any,
    whole: Any,
    substeps: Any,
    setpoint: Any,
    gravity: Any,
    motion: Any,
) -> None:
    run_ticks(
        array_at(parent, 3),
        array_at(prismatic, 3),
        array_at(tree, TREE),
        array_at(cable, CABLE),
        array_at(firmware, FIRMWARE),
        array_at(arm, ARM),
        array_at(control, CONTROL),
        array_at(whole, CONTROL_WHOLE),
        array_at(setpoint, 7).reshape((1, 7)),
        array_at(gravity, 3).reshape((1, 3)),
        array_at(motion, 9).reshape((1, 3, 3)),
        array_at(substeps, 1)[0],
        np.empty((0, LOG)),
    )
