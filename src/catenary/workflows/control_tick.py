"""What `run_loop` does between measuring and sending, as one compiled call: correct, hold, servo, limit."""

from collections.abc import Sequence
from copy import deepcopy
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats
from catenary.calibration import kernels as predictors
from catenary.calibration import layers
from catenary.calibration import tick as calibration_tick
from catenary.calibration.corrector import Corrector
from catenary.control import limits as torque_limits
from catenary.control import pd as joint_pd
from catenary.control.limits import TorqueLimits
from catenary.control.pd import JointPD
from catenary.dynamics.kernels import gravity_module
from catenary.errors import InputError
from catenary.kernels.array_layout import ArrayKind
from catenary.kernels.compiled import address_of, array_at
from catenary.kernels.llvm_calls import call_with, refusing
from catenary.kernels.numba_files import load_source, seal
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.trajectories.reference import Reference

CALLED = (calibration_tick, predictors, layers, torque_limits, joint_pd)
SOURCE = '''\
"""A control tick of arrays at addresses."""
# of {digest}


def tick({names}):
    {arrays}
    calibrated, torque, holding, feedback = work[0], work[1], work[2], work[3]
    {correct}
    pd(gains, calibrated, qd, q_ref, qd_ref, feedback, torque)
    hold(calibrated, gravity, holding)
    for j in range(len(torque)):
        torque[j] += holding[j]
    limit(rows, last, counts, torque, q, dt[0], sent)
'''
OWN = ("gains", "rows", "last", "counts", "layout", "memory", "work", "inside", "dt")
TAKEN = ("q", "qd", "tau", "gravity", "q_ref", "qd_ref", "sent")
CORRECT = "tick_state(layout, memory, q, qd, tau, calibrated, inside)"
COPY = "calibrated[:] = q"


class ControlTick:
    """Gravity torque plus joint PD at the calibrated positions, within limits: a state in, what to send out.

    It gives, bit for bit, what the parts give one after the other: `Corrector.correct_state`, `JointPD.torque` and
    the gravity kernel at the corrected positions, `TorqueLimits.apply` at the reported ones. For loops of one's own;
    `run_loop` calls the parts. The gravity vector is the state's.
    """

    def __init__(
        self,
        model: RobotModel,
        pd: JointPD,
        limits: TorqueLimits | None = None,
        corrector: Corrector | None = None,
        *,
        rate_hz: float = 1000.0,
    ) -> None:
        """Compile the tick.

        Args:
            model: The robot.
            pd: Gains.
            limits: On torque; None stops only NaN and infinity, which become zero torque.
            corrector: Of the joint positions; reported ones are taken for true without.
            rate_hz: Of the loop [Hz].

        Raises:
            MissingInertiaError: Links without inertia.
            InputError: Gains, limits or corrector are of other joints, or the rate is not the corrector's.
        """
        n = model.n
        self.limits = TorqueLimits(np.full(n, np.inf)) if limits is None else limits
        if len(pd.kp) != n or len(self.limits.torque) != n:
            raise InputError(
                f'robot "{model.name}" has {n} joints; gains are of {len(pd.kp)}, limits of {len(self.limits.torque)}'
            )
        if not 0.0 < rate_hz < np.inf:
            raise InputError(f"rate_hz: expected a positive rate, got {rate_hz}")
        self._made_of, self._corrector = (model, pd, limits, corrector, rate_hz), corrector
        arrays: tuple[NDArray[np.int64], Floats] = np.zeros(1, dtype=np.int64), np.zeros(1)
        if corrector is not None:
            corrector.prepare(model.joint_names, model.joint_units, rate_hz)
            arrays = corrector.robot_arrays
        self._work, self.inside = np.empty((4, n)), np.ones(n, dtype=bool)
        own = (
            pd.gains.rows,
            *self.limits.arrays,
            *arrays,
            self._work,
            self.inside,
            np.array([1.0 / rate_hz]),
        )
        self._own: tuple[NDArray[Any], ...] = own
        shapes = [(n,), (n,), (n,), (3,), (n,), (n,), (n,)]
        kinds = [
            ArrayKind("float64", shape, writable=name == "sent")
            for name, shape in zip(TAKEN, shapes, strict=True)
        ]
        address = _address(model, own, kinds, with_correction=corrector is not None)
        self._tick = call_with(address, own, kinds, refusing("control tick: other arrays"), gives=True)
        self.reset(np.zeros(n))

    def __deepcopy__(self, memo: dict[int, Any]) -> "ControlTick":
        """Give a tick of its own: the machine code knows where these arrays lie."""
        model, pd, limits, corrector, rate_hz = self._made_of
        pd, limits, corrector = deepcopy(pd, memo), deepcopy(limits, memo), deepcopy(corrector, memo)
        twin = ControlTick(model, pd, limits, corrector, rate_hz=rate_hz)
        for here, there in zip(self._own, twin._own, strict=True):
            there[...] = here
        return twin

    @property
    def q_calibrated(self) -> Floats:
        """Positions (n,) [rad|m] that the last tick took for true; overwritten by the next."""
        calibrated: Floats = self._work[0]
        return calibrated

    def reset(self, tau: ArrayLike) -> None:
        """Begin another motion, from a torque (n,) [Nm|N] that is being applied."""
        self.limits.reset(np.asarray(tau, dtype=float))
        if self._corrector is not None:
            self._corrector.reset()

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N] to send; `inside` then says which joints are inside the corrector's valid range.

        Raises:
            InputError: The state or reference is of another number of joints.
        """
        # as many names as there are: to gather them in a tuple takes as long as the tick
        q, qd, tau, gravity = state.q, state.qd, state.tau, state.gravity
        try:
            sent: Floats = self._tick(q, qd, tau, gravity, reference.q, reference.qd)
        except InputError:
            sent = self._torque_of_copies((q, qd, tau, gravity, reference.q, reference.qd))
        return sent

    def _torque_of_copies(self, seen: tuple[Floats, ...]) -> Floats:
        """Do the same with copies of arrays of another type or layout."""
        try:
            sent: Floats = self._tick(*(np.ascontiguousarray(values, dtype=float) for values in seen))
        except InputError:
            shapes = ", ".join(str(np.shape(values)) for values in seen)
            raise InputError(
                f"control tick: expected q, qd, tau, gravity, q_ref and qd_ref of a robot of {len(self.inside)} "
                f"joints, got arrays of {shapes}"
            ) from None
        return sent


def _address(
    model: RobotModel, own: Sequence[NDArray[Any]], kinds: Sequence[ArrayKind], *, with_correction: bool
) -> int:
    gravity = gravity_module(model)
    # numba does not see edits of what it calls: the digest makes another module of them
    texts = [Path(str(module.__file__)).read_bytes() for module in CALLED]
    digest = sha256(gravity.__name__.encode() + b"".join(texts)).hexdigest()[:32]
    names, shapes = (*OWN, *TAKEN), [array.shape for array in own] + [kind.shape for kind in kinds]
    lines = [f"{name} = array_at({name}, {shape})" for name, shape in zip(names, shapes, strict=True)]
    source = SOURCE.format(
        digest=digest,
        names=", ".join(names),
        arrays="\n    ".join(lines),
        correct=CORRECT if with_correction else COPY,
    )
    given = {
        "array_at": array_at,
        "hold": gravity.into,
        "pd": joint_pd.pd,
        "limit": torque_limits.limit,
        "tick_state": calibration_tick.tick_state,
    }
    module = load_source("control-tick", source, given)
    types = [array.dtype.name for array in own] + [kind.dtype for kind in kinds]
    address = address_of(module.tick, *types, in_memory=module.__file__ is None)
    seal(module)
    return address
