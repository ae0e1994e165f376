"""A calibration model in a control loop, tick by tick, with results identical to the fitted model's."""

import timeit
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.kernels.bind import bound
from catenary.plant import UNUSED_CHANNEL, Joints, JointState, joint_indices

_TIMED_TICKS = 50
_STATE_GROUPS = ("q", "qd", "tau")  # of a joint state, one after the other


class Corrector:
    """Calibrated joint positions, valid-range flags and intervals from the signals of each tick.

    Results equal those of `CalibrationModel.calibrate` bit for bit, for every kind of model. It keeps the model's play
    and friction states, which do not depend on the rate. Outside the valid range, or if an input is NaN, the flag is
    false and the fixed offset is added.

    `correct` and `correct_state` check and copy arrays at every tick; `bind` checks a loop's arrays once.

    Examples:
        >>> q = np.sin(np.linspace(0.0, 60.0, 1800))[:, None]
        >>> corrector = catenary.fit(q, 1.03 * q, units=["rad"], model="linear").corrector(rate_hz=1000.0)
        >>> corrected, inside = np.empty(1), np.empty(1, dtype=bool)
        >>> corrector.correct(np.array([0.5]), np.array([0.5]), corrected, inside)
        >>> corrected.round(4), inside
        (array([0.515]), array([ True]))
    """

    def __init__(self, model: CalibrationModel, *, rate_hz: float = 1000.0) -> None:
        """Compile the model's tick at a rate, which determines how far a joint may move in one tick."""
        if not 0.0 < rate_hz < float("inf"):
            raise InputError(f"rate_hz: expected a positive rate, got {rate_hz}")
        self.model = model
        self.rate_hz = rate_hz
        self._memory = model.features.memory()
        n, signals = len(model.joint_names), len(model.features.signals)
        self._q, self._signals, self._out = np.zeros(n), np.zeros(signals), np.zeros(n)
        self._inside, self._interval = np.zeros(n, dtype=bool), np.zeros(n)
        self._shapes = ((n,), (signals,), (n,), (n,))
        self._tick = self._bound()
        self._robot_shapes = ((-1,),) * 5  # of no robot yet: no joint state has -1 joints
        self._places, self._sources = np.arange(n), np.zeros(signals, dtype=np.int64)
        self._still = np.zeros(0)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_tick"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)  # a copy has its own arrays, so the call is bound again
        self._tick = self._bound()

    def _bound(self) -> Callable[[], None]:
        return self.bind(self._q, self._signals, self._out, self._inside, self._interval)

    def bind(
        self, q_nominal: Floats, signals: Floats, out: Floats, inside: Flags, interval: Floats | None = None
    ) -> Callable[[], None]:
        """Return a call without arguments that takes one tick on these arrays, which are checked only now.

        Args:
            q_nominal: (n,) float64: holds the reported positions [rad|m] at each call.
            signals: (S,) float64: current values of `model.features.signals`, in that order.
            out: (n,) float64: receives the calibrated positions [rad|m]; not the memory of `q_nominal`.
            inside: (n,) bool: receives whether each joint is inside the model's valid range.
            interval: (n,) float64: receives half-widths about `out` [rad|m], NaN if the model has none.

        Raises:
            InputError: An array has another shape, type or layout, or two share their memory.
        """
        self._require_shapes(q_nominal, signals, out, inside, interval)
        arrays = (q_nominal[None], signals[None], out[None], inside[None], None if interval is None else interval[None])
        return bound(self.model.tick_steps(self._memory, *arrays, rate_hz=self.rate_hz))

    def _require_shapes(
        self, q: ArrayLike, signals: ArrayLike, out: Floats, inside: Flags, interval: Floats | None
    ) -> None:
        shapes = tuple(np.shape(array) for array in (q, signals, out, inside, interval) if array is not None)
        names = ("q_nominal", "signals", "out", "inside", "interval")
        if shapes != (*self._shapes, out.shape)[: len(shapes)]:
            expected = ", ".join(map("{} {}".format, names, (*self._shapes, self._shapes[2])))
            raise InputError(f"corrector: expected {expected} or none, got {', '.join(map(str, shapes))}")

    def correct(
        self, q_nominal: ArrayLike, signals: ArrayLike, out: Floats, inside: Flags, interval: Floats | None = None
    ) -> None:
        """Take one tick; arrays as in `bind`, and `out` may be `q_nominal`."""
        self._require_shapes(q_nominal, signals, out, inside, interval)
        self._q[:], self._signals[:] = q_nominal, signals
        self._tick()
        out[:], inside[:] = self._out, self._inside
        if interval is not None:
            interval[:] = self._interval

    def tick_seconds(self) -> float:
        """Return the median time of a tick on this computer [s]; the corrector's state is unchanged."""
        other = Corrector(self.model, rate_hz=self.rate_hz)
        return median(timeit.repeat(other._tick, number=1, repeat=_TIMED_TICKS))

    @property
    def leaps(self) -> dict[str, int]:
        """Number of spikes of each position, which play states ignored."""
        return self.model.features.spikes(self._memory)

    def reset(self) -> None:
        """Forget all previous ticks, before another motion; `leaps` is kept."""
        self._memory.clear()

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Match the model to a robot's joints by name; the robot may have more joints.

        A RAVEN-II's unused channel, which is in no joint state, is assumed to read its mean in training.

        Raises:
            InputError: The robot lacks a joint or an input of the model, or has it in another unit.
        """
        model, robot = self.model, ", ".join(joint_names)
        for why in model.asked_of_reports:
            raise InputError(f"corrector: {why}, or deploy --as-is if it reports them corrected")
        of_robot = Joints(tuple(joint_names), tuple(joint_units))
        places = joint_indices(model, of_robot, whose="corrector: the robot", of="the model is for")
        size, sources, still = len(joint_names), list[int](), list[float]()
        for signal in model.features.signals:
            group, _, joint = signal.partition(":")
            if joint == UNUSED_CHANNEL and joint not in joint_names:
                sources.append(len(_STATE_GROUPS) * size + len(still))  # after the joint state, which lacks it
                place = model.features.signals.index(signal)  # signals come first among the features
                means = [g.valid_range.mean[g.watched == place] for g in model.groups if (g.watched == place).any()]
                still.append(float(means[0][0]) if means else 0.0)
                continue
            if group not in _STATE_GROUPS or joint not in joint_names:
                raise InputError(f'corrector: input "{signal}" is in no joint state; expected q, qd or tau of {robot}')
            sources.append(_STATE_GROUPS.index(group) * size + joint_names.index(joint))
        self._robot_shapes = ((size,),) * 5
        self._places = places
        self._sources, self._still = np.array(sources, dtype=np.int64), np.array(still)
        self.reset()

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats | None = None) -> None:
        """Correct one tick of the robot named in `prepare`; outputs as in `bind`, for the robot's joints (n,).

        Joints without a model keep their reported position, are inside, and have intervals of NaN.
        """
        shapes = (state.q.shape, state.qd.shape, state.tau.shape, out.shape, inside.shape)
        if shapes != self._robot_shapes or (interval is not None and interval.shape != out.shape):
            raise InputError(
                "corrector: q, qd, tau, out, inside and interval are not of the robot that it was prepared for: "
                + ", ".join(map(str, shapes))
            )
        self._signals[:] = np.concatenate((state.q, state.qd, state.tau, self._still))[self._sources]
        self._q[:] = state.q[self._places]
        self._tick()
        out[:] = state.q
        inside[:] = True
        out[self._places], inside[self._places] = self._out, self._inside
        if interval is not None:
            interval[:] = np.nan
            interval[self._places] = self._interval
