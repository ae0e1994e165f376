"""A cable's memory: Bouc-Wen for what it forgets by moving, Maxwell for what it forgets by waiting."""

from catenary.compiled import inlined


@inlined
def bouc_wen_step(state: float, stretching: float, width: float) -> float:
    """Bouc-Wen state after the stretch has grown by `stretching`.

    dz = ds / w (1 - |z| (1/2 sgn(ds z) + 1/2)), kept within -1 and 1. Rate-independent: only the path counts.

    Args:
        state: z before.
        stretching: ds [rad or m].
        width: w, the stretch at which it yields [rad or m].
    """
    grip = abs(state) if stretching * state > 0.0 else 0.0
    state = state + stretching / width * (1.0 - grip)
    return min(max(state, -1.0), 1.0)


@inlined
def maxwell_step(slow_stretch: float, stretch: float, step: float, time_constant: float) -> float:
    """Stretch that a Maxwell branch has forgotten, a time `step` [s] on: ds_v/dt = (s - s_v) / time_constant."""
    return slow_stretch + (stretch - slow_stretch) * step / time_constant
