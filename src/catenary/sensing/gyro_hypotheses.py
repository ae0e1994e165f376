"""Gyroscope checked against the accelerometer: hypotheses of sign, axes, unit, scale and delay compete on recent data.

In axes that turn by omega, gravity less the acceleration of the origin changes by du/dt = -omega x u, and a sensor at a
position L from a fixed point reads u - alpha x L - omega x (omega x L). Each hypothesis is a variant of the gyroscope:
as read, in other axes, in another unit or scale, delayed, or unrelated to the base. L and the gyroscope's bias are
unknowns of each, so that a wrong or missing position does not condemn a correct gyroscope. Their sums are updated
sample by sample (gyro_evidence.py).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.gyro_evidence import GyroEvidence
from catenary.sensing.imu_faults import Fault

_SPANS_S = (0.8, 4.0)  # [s] of data: short for fast detection, long for small faults
_INTERVAL_S = 0.05  # [s] between comparisons over each of them
_RESTART_S = 0.4  # [s] between restarts of the high-pass while the gyroscope is wrong, so that its end shows soon
_BIAS_S = 10.0  # [s] averaging time of the bias fitted in turns
# [nats] likelihood ratios that confirm a gyroscope, and that accuse it beyond a hypothesis's price
_CONFIRM_NATS, _ACCUSE_NATS = 3.0, 6.0
_MIN_DIFFERENCE = 0.35  # of a variant's rates from those read, relative: smaller ones do not count
_FIT_FACTOR = 1.5  # times the residual allowed by noise and mistuning: a smaller one needs no explanation
_MAX_UNFIT_FACTOR = 25.0  # times the residual without any gyroscope: that of a correct one is never so large
_SHOWN_TURN_RAD = 0.1  # [rad] least turn about the vertical that confirms rates which gravity does not contradict


class Variant(NamedTuple):
    """An interpretation of a gyroscope: true rate = matrix @ rate, `late` [s] before its stamp."""

    matrix: Floats
    late: float = 0.0


@dataclass(frozen=True, eq=False)
class RateExplanation:
    """A fault hypothesis of a gyroscope: its variants, the log-likelihood it must gain, and its remedy."""

    fault: Fault
    variants: Sequence[Variant]
    price: float  # [nats]
    remedy: Callable[[Variant], str]


def _axis_order(variant: Variant) -> str:
    """Return the signed order of axes in the notation of `--axes`: the sensor's axes that give x, y and z."""
    order = ("-" * int(row.sum() < 0.0) + "xyz"[int(np.abs(row).argmax())] for row in variant.matrix)
    return f"its x, y, z seem to be {','.join(order)}"


def _scale_text(variant: Variant) -> str:
    return f"gravity turns {variant.matrix[0, 0]:.3g} times as far as the gyroscope reads"


def _delay_text(variant: Variant) -> str:
    return f"its rates are about {1000.0 * abs(variant.late):.0f} ms {'late' if variant.late > 0.0 else 'early'}"


_ORDERS = [
    Variant(np.eye(3)[list(p)] * np.array(s)[:, None])
    for p in permutations(range(3))
    for s in product((1, -1), repeat=3)
]
_SIGN_PRICE = 0.3  # [nats] of each sign that is turned
_MOUNTS = [np.diag([1.0, -1.0, -1.0]), -np.eye(3), np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])]
_SCALES = np.r_[np.geomspace(0.1, 0.8, 7), np.geomspace(1.25, 10.0, 7)]
_DELAYS_S = (-0.2, -0.15, -0.1, -0.06, -0.03, 0.03, 0.06, 0.1, 0.15, 0.2)
_EXPLANATIONS = (
    RateExplanation(Fault.NONE, [_ORDERS[0]], 0.0, lambda _: ""),
    RateExplanation(Fault.RATE_CONTRADICTS, [Variant(np.zeros((3, 3)))], 2.0, lambda _: ""),
    RateExplanation(Fault.RATE_SIGN, _ORDERS[1:8], 3.7, _axis_order),
    RateExplanation(Fault.RATE_AXES, _ORDERS[8:], 5.0, _axis_order),
    RateExplanation(Fault.RATE_UNIT, [Variant(np.radians(np.eye(3)))], 3.0, lambda _: "it seems to be in deg/s"),
    RateExplanation(Fault.RATE_UNIT, [Variant(np.degrees(np.eye(3)))], 3.0, lambda _: "it seems to be divided by 57.3"),
    RateExplanation(Fault.RATE_SCALE, [Variant(s * np.eye(3)) for s in _SCALES.tolist()], 5.0, _scale_text),
    # the first is as read, over the same time as the delayed ones: what they are compared with
    RateExplanation(Fault.RATE_DELAY, [Variant(np.eye(3), t) for t in (0.0, *_DELAYS_S)], 5.0, _delay_text),
)
_VARIANTS = [(record, variant) for record in _EXPLANATIONS for variant in record.variants]
_FAULTS = [record.fault for record, _ in _VARIANTS]
_IS_DELAY = np.array([fault is Fault.RATE_DELAY for fault in _FAULTS])
_AS_READ = np.where(_IS_DELAY, _FAULTS.index(Fault.RATE_DELAY), 0)  # (K,) index of the one to compare with
# among equal variants the simplest wins: common mountings (such as aircraft axes), then few negated axes
_PRICES = np.array(
    [record.price - 1.0 * any((variant.matrix == m).all() for m in _MOUNTS) for record, variant in _VARIANTS]
)
_PRICES += _SIGN_PRICE * np.array([np.sum(variant.matrix < 0.0) for _, variant in _VARIANTS])
# shares of the prices used to confirm a gyroscope: scale and delay are almost indistinguishable from a lever arm
_SHARES = np.array([0.8 if fault in (Fault.RATE_SCALE, Fault.RATE_DELAY) else 0.5 for fault in _FAULTS])


class Result(NamedTuple):
    """Result of comparing all hypotheses."""

    fault: Fault = Fault.NONE  # of the gyroscope; NONE also if undecided
    is_right: bool = False  # gravity turns with it, and no other variant explains that as well
    is_unopposed: bool = False  # it turns about the vertical, and gravity does not contradict it
    remedy: str = ""  # correction, as text
    variants: tuple[int, ...] = ()  # indices of those that correct it about as well
    bias: Floats | None = None  # (3,) [rad/s] of the gyroscope as read


def evidence(place: Floats, spans: Sequence[float]) -> GyroEvidence:
    """Return empty sums of all variants.

    Args:
        place: (3,) position of the sensor from the base's origin, in the sensor's axes [m].
        spans: Lengths of the data [s]; inf for all.
    """
    matrices = np.array([variant.matrix for _, variant in _VARIANTS])
    return GyroEvidence(place, spans, matrices, np.array([variant.late for _, variant in _VARIANTS]), _IS_DELAY)


def compare(
    sums: GyroEvidence,
    span: int = 0,
    *,
    drift: float = 0.0,
    noise: tuple[float, float] = (0.0, 0.0),
    rested: bool = False,
    before: Result = Result(),  # noqa: B008  # immutable
) -> Result:
    """Compare all hypotheses about a gyroscope by their likelihood.

    Args:
        sums: Data, over several spans of time.
        span: Index of the span.
        drift: Accelerations of the base that remain in the rows [m/s2].
        noise: Standard deviations of a sample of gravity [m/s2] and of a rate [rad/s].
        rested: The bias was measured at rest and subtracted.
        before: Earlier result; a gyroscope found wrong is compared with its correction.
    """
    fit = sums.fit(span, drift=drift, noise=noise, rested=rested)
    if fit is None:
        return Result()
    residuals, floor = fit.residuals, fit.allowed
    is_upright = fit.is_upright and fit.angle > _SHOWN_TURN_RAD
    fits = residuals[0] < min(_FIT_FACTOR * floor[0], _MAX_UNFIT_FACTOR * max(residuals[1], floor[1]))
    if fits and (before.is_right or is_upright or (residuals[:2] < _FIT_FACTOR * floor[1]).all()):
        return Result(is_unopposed=is_upright, bias=fit.bias)
    cost = fit.weights * np.log(residuals + floor)
    gains = cost[_AS_READ] - cost  # over the gyroscope as read [nats]
    best = int(np.argmax(gains - _PRICES))
    record, variant = _VARIANTS[best]
    if gains[best] - _PRICES[best] > _ACCUSE_NATS:
        if record.fault is Fault.RATE_SCALE:
            variant = Variant(_best_scale(best, residuals) * np.eye(3))
        alike = [
            k for k, (other, _) in enumerate(_VARIANTS) if other is record and gains[k] > gains[best] - _CONFIRM_NATS
        ]
        return Result(record.fault, remedy=record.remedy(variant), variants=tuple(alike))
    counts = fit.differences > _MIN_DIFFERENCE**2
    rivals = gains - _SHARES * _PRICES
    is_right = counts.any() and (rivals[counts] < -_CONFIRM_NATS).all()
    if before.fault is not Fault.NONE:  # it is right again once its correction no longer helps
        is_right = (gains[list(before.variants)] < -_CONFIRM_NATS).all() and residuals[0] < _FIT_FACTOR * floor[0]
    return Result(is_right=bool(is_right), bias=fit.bias if is_right else None)


def _best_scale(best: int, residuals: Floats) -> float:
    """Return the scale of least residual, by a parabola through the best variant and its neighbours."""
    first, half = _FAULTS.index(Fault.RATE_SCALE), len(_SCALES) // 2
    scales = np.insert(_SCALES, half, 1.0)
    squares = np.insert(residuals[first : first + len(_SCALES)], half, residuals[0])
    middle = int(np.clip(np.flatnonzero(scales == _VARIANTS[best][1].matrix[0, 0])[0], 1, len(scales) - 2))
    near = slice(middle - 1, middle + 2)
    a, b, _ = np.polyfit(scales[near], squares[near], 2)
    return float(np.clip(-0.5 * b / a, scales[middle - 1], scales[middle + 1]))


class TurningWatch:
    """Check a gyroscope against gravity, repeatedly over the last seconds of samples.

    A gyroscope that was found wrong stays wrong until a turn shows that it is right.
    """

    def __init__(self, place: Floats, drift: float, *, checked: bool = False) -> None:
        """Set the sensor's place and the base's drift, as of `compare`, and if a tumble has confirmed the gyroscope."""
        self._sums, self._drift = evidence(place, _SPANS_S), drift
        self.result, self.may_be_used = Result(is_right=checked), checked
        self.fitted_bias: Floats | None = None  # (3,) [rad/s] fitted in recent turns
        self._was_right = checked
        self._bias: Floats | None = None
        self._restarted = -np.inf  # [s]
        self._due = np.array([-np.inf, -np.inf])  # [s] of the next comparison over each span

    def mistaken(self, gravity: Floats) -> float:
        """Return the error of gravity (3,) [m/s2], at most, if the accelerometer's axes changed, not the gyroscope's.

        It is 0 unless the gyroscope was confirmed before: the accelerometer is trusted first. Rates do not show if all
        of its axes are negated, so the smaller change is taken.
        """
        if not self._was_right or self.result.fault not in (Fault.RATE_SIGN, Fault.RATE_AXES):
            return 0.0
        turned = gravity @ np.array([_VARIANTS[k][1].matrix for k in self.result.variants])
        return float(np.linalg.norm([gravity - turned, gravity + turned], axis=2).min(axis=0).max())

    def doubt(self) -> None:
        """Withdraw a confirmation after a jump of rates that no base can make."""
        if self.result.fault is Fault.NONE:
            self.result, self.may_be_used = Result(), False

    def add_rate(self, stamp: float, rate: Floats, bias: Floats | None) -> None:
        """Add a rate (3,) [rad/s] in the sensor's axes, and the gyroscope's bias (3,) once it was measured at rest."""
        if self._bias is None and bias is not None:
            self._sums.restart()
        self._bias = bias
        self._sums.add_rate(stamp, rate if bias is None else rate - bias)

    def add_gravity(self, stamp: float, gravity: Floats, noise: tuple[float, float]) -> None:
        """Add gravity (3,) [m/s2] in the sensor's axes, with the noise of `compare`; at times compare over a span."""
        if not self._sums.add_gravity(stamp, gravity):
            return
        if self.result.fault is not Fault.NONE and stamp - self._restarted > _RESTART_S:
            self._sums.restart_high_pass()
            self._restarted = stamp
        for span, due in enumerate(self._due.tolist()):
            if stamp >= due:
                self._due[span] = stamp + _INTERVAL_S
                self._conclude(span, noise)
                return  # the other span at the next row

    def _conclude(self, span: int, noise: tuple[float, float]) -> None:
        rested = self._bias is not None
        comparison = compare(self._sums, span, drift=self._drift, noise=noise, rested=rested, before=self.result)
        if span == 1 and comparison.bias is not None:
            known = comparison.bias if self.fitted_bias is None else self.fitted_bias
            self.fitted_bias = known + _INTERVAL_S / _BIAS_S * (comparison.bias - known)
        self.may_be_used |= comparison.is_unopposed and self.result.fault is Fault.NONE
        if comparison.is_right:
            if self.result.fault is not Fault.NONE:
                self._sums.forget_before(span)  # earlier samples are of a wrong gyroscope
            self.result, self.may_be_used, self._was_right = comparison, True, True
        elif comparison.fault is not Fault.NONE:
            self.result, self.may_be_used = comparison, False
