"""A cable's memory: hysteresis, which motion alone changes (Bouc-Wen), and creep, which takes time (Maxwell)."""

import math

from catenary.kernels.compiled import inlined


@inlined
def bouc_wen_step(state: float, stretching: float, width: float) -> float:
    """Return the Bouc-Wen state after the stretch has grown by `stretching`.

    dz = ds / w (1 - |z| (1/2 sgn(ds z) + 1/2)): unloading follows a straight line to zero, loading nears 1
    exponentially. Both are solved exactly, so only the path counts, not the steps in which it is taken, and z
    stays between -1 and 1.

    Args:
        state: z before.
        stretching: ds [rad or m].
        width: w, the stretch at which it yields [rad or m].
    """
    side = 1.0 if stretching >= 0.0 else -1.0
    way = abs(stretching) / width
    along = side * state  # negative while it unloads
    if along + way <= 0.0:
        return state + side * way
    if along < 0.0:
        way += along
        along = 0.0
    return side * (along - (1.0 - along) * math.expm1(-way))


@inlined
def maxwell_step(slow_stretch: float, stretch: float, step: float, time_constant: float) -> float:
    """Return the stretch that a Maxwell branch has relaxed, `step` [s] later: ds_v/dt = (s - s_v) / time_constant."""
    return slow_stretch + (stretch - slow_stretch) * step / time_constant
