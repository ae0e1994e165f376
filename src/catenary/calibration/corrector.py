"""A calibration model inside a control loop: one compiled call per tick, the bits of the fitted model."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.dataset import RATE_TOLERANCE
from catenary.calibration.model import CalibrationModel
from catenary.calibration.tick import (
    SOURCES,
    clear,
    fuse,
    tick_rows,
    with_robot,
)
from catenary.calibration.tick_calls import tick_call, tick_state_call
from catenary.errors import InputError
from catenary.plant import JointState

Flags = NDArray[np.bool_]


class Corrector:
    """Calibrated joint positions and valid-range flags from the signals of each tick.

    Gives what `CalibrationModel.calibrate` gives, bit for bit, whatever the kind of model. It keeps the previous
    positions and play states that the model takes. Until `history` of them have been seen, outside the valid range
    and where an input is NaN, the flag is false and the fixed offset is added.

    Previous positions lie `decimation` ticks apart, as far in time as the training rows did; they are taken anew at
    every tick, so the correction is as smooth as the motion. Play states need no rate.
    """

    correct: Callable[[Floats, Floats, Floats, Flags], None]
    """Take one tick, in machine code: `correct(q_nominal, signals, out, inside)`.

    Args:
        q_nominal: (n,) positions that the robot reports [rad|m].
        signals: (S,) current values of `model.features.signals`, in that order.
        out: (n,) receives the calibrated positions [rad|m].
        inside: (n,) receives whether each joint is inside the model's valid range.

    Raises:
        InputError: An array has another size.
    """

    def __init__(
        self, model: CalibrationModel, *, rate_hz: float = 1000.0, decimation: int | None = None
    ) -> None:
        """Compile the model's tick.

        Args:
            model: The model.
            rate_hz: Rate of the loop [Hz]; matters to models with history only.
            decimation: Ticks between previous positions; None divides the loop's rate by the training rows'.

        Raises:
            InputError: The model has history, and its training rows' rate is not known and `decimation` is None,
                or no whole number of ticks is as long as their spacing, to 3 %; or its parts do not fit together.
        """
        self.model = model
        self.rate_hz = rate_hz
        self.decimation = _decimation(model, rate_hz, decimation)
        self._layout, self._memory = fuse(model, self.decimation)
        # of a robot whose joints are the model's, until `prepare` says more
        self._robot_layout = self._layout
        self._make_calls()

    def _make_calls(self) -> None:
        self.correct = tick_call(self._layout, self._memory)
        self._state_call = tick_state_call(self._robot_layout, self._memory)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("correct", "_state_call")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)  # a copy has a memory of its own, and so calls
        self._make_calls()

    def reset(self) -> None:
        """Forget all previous ticks: another motion begins."""
        clear(self._layout, self._memory)

    def run(self, q_nominal: Floats, signals: Floats) -> tuple[Floats, Flags]:
        """Take a whole recording in one call, from its first row on.

        Args:
            q_nominal: (N, n) reported positions [rad|m].
            signals: (N, S) values of `model.features.signals`.

        Returns:
            (N, n) calibrated positions [rad|m], and (N, n) whether each is inside the valid range.

        Raises:
            InputError: An array has another shape.
        """
        q = as_array("q_nominal", q_nominal, (None, len(self.model.joint_names)), finite=False)
        rows = as_array("signals", signals, (len(q), len(self.model.features.signals)), finite=False)
        out, inside = np.empty_like(q), np.empty(q.shape, dtype=bool)
        self.reset()
        tick_rows(self._layout, self._memory, q, rows, out, inside)
        return out, inside

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Get ready for the joint states of a robot, which may have joints that the model does not.

        Raises:
            InputError: The robot lacks a joint of the model, or has it in another unit; an input is no position,
                velocity or torque of its joints; or the model has history and the loop runs at another rate.
        """
        model, robot = self.model, ", ".join(joint_names)
        for name, unit in zip(model.joint_names, model.joint_units, strict=True):
            if name not in joint_names:
                raise InputError(f'corrector: the robot has no joint "{name}"; it has {robot}')
            if joint_units[joint_names.index(name)] != unit:
                raise InputError(
                    f'corrector: joint "{name}" is in {joint_units[joint_names.index(name)]}, the model in {unit}'
                )
        if model.features.history > 0 and abs(rate_hz / self.rate_hz - 1.0) > RATE_TOLERANCE:
            raise InputError(
                f"corrector: made for {self.rate_hz:g} Hz, the loop runs at {rate_hz:g} Hz; the model's previous "
                f"positions would lie at other times. Make it with rate_hz={rate_hz:g}"
            )
        sources = []
        for signal in model.features.signals:
            group, _, joint = signal.partition(":")
            if group not in SOURCES or joint not in joint_names:
                raise InputError(
                    f'corrector: input "{signal}" is in no joint state; expected q, qd or tau of {robot}'
                )
            sources.append((SOURCES.index(group), joint_names.index(joint)))
        places = [joint_names.index(name) for name in model.joint_names]
        size = len(joint_names)
        self._robot_layout = with_robot(self._layout, places, sources, size)
        self._state_call = tick_state_call(self._robot_layout, self._memory)
        self.reset()

    def correct_state(self, state: JointState, out: Floats, inside: Flags) -> None:
        """Take one tick of the robot that `prepare` was told of.

        Args:
            state: What the robot reports.
            out: (n,) receives the calibrated positions [rad|m]; joints without a model pass through.
            inside: (n,) receives the flags; true for joints without a model.

        Raises:
            InputError: An array has another size than the robot's joints.
        """
        self._state_call(state.q, state.qd, state.tau, out, inside)


def _decimation(model: CalibrationModel, rate_hz: float, decimation: int | None) -> int:
    if not 0.0 < rate_hz < float("inf"):
        raise InputError(f"rate_hz: expected a positive rate, got {rate_hz}")
    if decimation is not None and decimation < 1:
        raise InputError(f"decimation: expected one or more ticks, got {decimation}")
    history, trained = model.features.history, model.rate_hz
    if history == 0:
        return 1
    if trained is None:
        if decimation is None:
            raise InputError(
                f"corrector: the model takes {history} previous positions, and its training recordings do not say "
                "how far apart in time they lie; give `decimation`, the number of ticks between them"
            )
        return decimation
    ticks = decimation or max(1, round(rate_hz / trained))
    if abs(rate_hz / ticks / trained - 1.0) > RATE_TOLERANCE:
        raise InputError(
            f"corrector: the model's {history} previous positions lie {1.0 / trained:.4g} s apart ({trained:.4g} Hz); "
            f"{ticks} tick(s) at {rate_hz:g} Hz are {ticks / rate_hz:.4g} s, more than {RATE_TOLERANCE:.0%} off. "
            "Run the loop at a multiple of the training rate, or train at a fraction of the loop's, "
            "or use play states, which need no rate"
        )
    return ticks
