"""Gyroscope checked against the accelerometer: hypotheses of sign, axes, unit, scale and delay compete on recent data.

In axes that turn by omega, gravity less the acceleration of the origin changes by du/dt = -omega x u, and a sensor at a
position L from a fixed point reads u - alpha x L - omega x (omega x L). Each hypothesis is a variant of the gyroscope:
as read, in other axes, in another unit or scale, delayed, or unrelated to the base. L and the gyroscope's bias are
unknowns of each, so that a wrong or missing position does not condemn a correct gyroscope.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.imu_faults import Fault

_STEP_S, _LONG_STEP_S, _LONG_S = 0.01, 0.02, 1.0  # [s] averaged in a row, and in pieces longer than a second
HIGH_PASS_S = 0.5  # [s] time constant of the high-pass that removes motion slower than turning
_MIN_ROWS = 8  # for a comparison
_SUM_SPACING_S = 0.0095  # [s] between stored sums
_LEVER_M = 0.5  # [m] prior standard deviation of the position of the centre of rotation
_BIAS, _BIAS_AT_REST = 0.05, 0.005  # [rad/s] prior standard deviation of the bias, and after a rest
_NOISE = 0.03  # [m/s2] of the residual, beyond the sensor's noise
_MISTUNING_SHARE = 0.04  # of the effect of turning: scale and alignment errors of a cheap, correct sensor
_ROWS_PER_S = 12.0  # independent rows in a second
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
_SCALES = np.r_[np.geomspace(0.1, 0.8, 7), np.geomspace(1.25, 10.0, 7), -1.0]
_EXPLANATIONS = (
    RateExplanation(Fault.NONE, [_ORDERS[0]], 0.0, lambda _: ""),
    RateExplanation(Fault.RATE_CONTRADICTS, [Variant(np.zeros((3, 3)))], 2.0, lambda _: ""),
    RateExplanation(Fault.RATE_SIGN, _ORDERS[1:8], 3.7, _axis_order),
    RateExplanation(Fault.RATE_AXES, _ORDERS[8:], 5.0, _axis_order),
    RateExplanation(Fault.RATE_UNIT, [Variant(np.radians(np.eye(3)))], 3.0, lambda _: "it seems to be in deg/s"),
    RateExplanation(Fault.RATE_UNIT, [Variant(np.degrees(np.eye(3)))], 3.0, lambda _: "it seems to be divided by 57.3"),
    RateExplanation(Fault.RATE_SCALE, [Variant(s * np.eye(3)) for s in _SCALES[:-1].tolist()], 5.0, _scale_text),
    RateExplanation(
        Fault.RATE_DELAY,
        [Variant(np.eye(3), t) for t in (-0.2, -0.15, -0.1, -0.06, -0.03, 0.03, 0.06, 0.1, 0.15, 0.2)],
        5.0, _delay_text,
    ),
)  # fmt: skip
_VARIANTS = [(record, variant) for record in _EXPLANATIONS for variant in record.variants]
_MATRICES = np.array([variant.matrix for _, variant in _VARIANTS])
# among equal variants the simplest wins: common mountings (such as aircraft axes), then few negated axes
_PRICES = np.array(
    [record.price - 1.0 * any((variant.matrix == m).all() for m in _MOUNTS) for record, variant in _VARIANTS]
)
_PRICES += _SIGN_PRICE * np.sum(_MATRICES < 0.0, axis=(1, 2))
_DELAYS_S = np.array([variant.late for _, variant in _VARIANTS])
# shares of the prices used to confirm a gyroscope: scale and delay are almost indistinguishable from a lever arm
_SHARES = np.array([0.8 if record.fault in (Fault.RATE_SCALE, Fault.RATE_DELAY) else 0.5 for record, _ in _VARIANTS])


class Result(NamedTuple):
    """Result of comparing all hypotheses."""

    fault: Fault = Fault.NONE  # of the gyroscope; NONE also if undecided
    is_right: bool = False  # gravity turns with it, and no other variant explains that as well
    is_unopposed: bool = False  # it turns about the vertical, and gravity does not contradict it
    remedy: str = ""  # correction, as text
    variants: tuple[int, ...] = ()  # indices of those that correct it about as well
    bias: Floats | None = None  # (3,) [rad/s] of the gyroscope as read
    matrix: Floats | None = None  # (3, 3) from its axes, or the accelerometer's, to the true ones


class SensedTurn(NamedTuple):
    """Integrals of gravity (N, 3) [m/s] at times (N,) [s], and of rates (M, 3) [rad], in the sensor's axes."""

    times: Floats
    gravity: Floats
    rate_times: Floats
    angles: Floats


class _Residuals(NamedTuple):
    """Normal equations of a piece for K variants: products of residual rows and of the unknowns' columns."""

    squares: Floats  # (K,) of the residual rows
    against: Floats  # (K, 6) of rows and unknowns
    unknowns: Floats  # (K, 6, 6)
    rows: int
    span: float  # [s]
    turned: Floats  # (K,) squared effect of turning and of the given lever arm
    differs: Floats  # (K,) squared relative difference from the rates as read
    swing: float  # [1/s] noise of angular acceleration, per noise of a rate
    is_upright: bool  # it turns mostly about the vertical
    angle: float  # [rad] total turn


def integral(times: Floats, values: Floats) -> Floats:
    """Return the trapezoidal integral (N, 3) of values over times, from the first.

    Args:
        times, values: (N,), (N, 3).
    """
    steps = 0.5 * np.diff(times)[:, None] * (values[1:] + values[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def compare(
    pieces: Sequence[SensedTurn],
    place: Floats,
    *,
    drift: float = 0.0,
    noise: tuple[float, float] = (0.0, 0.0),
    rested: bool = False,
    before: Result = Result(),  # noqa: B008  # immutable
) -> Result:
    """Compare all hypotheses about a gyroscope by their likelihood.

    Args:
        pieces: Intervals of data.
        place: (3,) position of the sensor from the base's origin, in the sensor's axes [m].
        drift: Accelerations of the base that remain in the rows [m/s2].
        noise: Standard deviations of a sample of gravity [m/s2] and of a rate [rad/s].
        rested: The bias was measured at rest and subtracted.
        before: Earlier result; a gyroscope found wrong is compared with its correction.
    """
    parts = _all_residuals(pieces, place, _MATRICES[:2], _DELAYS_S[:2])  # as read, and unrelated to the base
    if not parts:
        return Result()
    swing = max(part.swing for part in parts) * noise[1] * float(np.linalg.norm(place))  # noise times lever arm
    variance = _NOISE**2 + drift**2 + (0.5 * noise[0]) ** 2 + swing**2
    is_upright = all(part.is_upright for part in parts) and max(part.angle for part in parts) > _SHOWN_TURN_RAD
    residuals, floor, biases = _residuals(parts, variance, rested=rested)
    fits = residuals[0] < min(_FIT_FACTOR * floor[0], _MAX_UNFIT_FACTOR * max(residuals[1], floor[1]))
    if fits and (before.is_right or is_upright or (residuals < _FIT_FACTOR * floor[1]).all()):
        return Result(is_unopposed=is_upright, bias=biases[0])
    parts = _all_residuals(pieces, place, _MATRICES, _DELAYS_S)
    residuals, floor, biases = _residuals(parts, variance, rested=rested)
    cost = 0.5 * _ROWS_PER_S * sum(part.span for part in parts) * np.log(residuals + floor)
    gains = cost[0] - cost  # over the gyroscope as read [nats]
    best = int(np.argmax(gains - _PRICES))
    record, variant = _VARIANTS[best]
    if gains[best] - _PRICES[best] > _ACCUSE_NATS:
        if record.fault is Fault.RATE_SCALE:
            matrices = np.geomspace(0.75, 1.34, 31)[:, None, None] * variant.matrix
            refined = _all_residuals(pieces, place, matrices, np.zeros(31))
            variant = Variant(matrices[int(np.argmin(_residuals(refined, variance, rested=rested)[0]))])
        alike = [
            k for k, (other, _) in enumerate(_VARIANTS) if other is record and gains[k] > gains[best] - _CONFIRM_NATS
        ]
        return Result(record.fault, remedy=record.remedy(variant), variants=tuple(alike), matrix=variant.matrix)
    counts = np.sum([part.differs for part in parts], axis=0) > _MIN_DIFFERENCE**2 * len(parts)
    rivals = gains - _SHARES * _PRICES
    is_right = counts.any() and (rivals[counts] < -_CONFIRM_NATS).all()
    if before.fault is not Fault.NONE:  # it is right again once its correction no longer helps
        is_right = (gains[list(before.variants)] < -_CONFIRM_NATS).all() and residuals[0] < _FIT_FACTOR * floor[0]
    return Result(is_right=bool(is_right), bias=biases[0] if is_right else None)


def _all_residuals(pieces: Sequence[SensedTurn], place: Floats, matrices: Floats, late: Floats) -> list[_Residuals]:
    parts = [_piece_residuals(piece, place, matrices, late) for piece in pieces]
    return [part for part in parts if part is not None]


def _piece_residuals(piece: SensedTurn, place: Floats, matrices: Floats, late: Floats) -> _Residuals | None:
    """Return the normal equations of a piece for each variant; None if it is too short."""
    begin, end = max(piece.times[0], piece.rate_times[0]), min(piece.times[-1], piece.rate_times[-1])
    gap = float(np.median(np.diff(piece.times)))
    step = max(_LONG_STEP_S if end - begin > _LONG_S else _STEP_S, 1.01 * gap)
    grid = np.arange(begin, end, step)
    if len(grid) < _MIN_ROWS + 2:
        return None
    z = np.diff(_at(grid, piece.times, piece.gravity), axis=0) / step
    rates = {s: np.diff(_at(grid + s, piece.rate_times, piece.angles), axis=0) / step for s in set(late.tolist())}
    read = np.array([rates[s] for s in late.tolist()])  # (K, N, 3)
    w = np.einsum("kij,knj->kin", matrices, read)
    a = np.gradient(w, step, axis=2)
    p = np.concatenate([place[:, None], np.eye(3)], axis=1)  # the position, and its unknown error
    lever = np.stack([_lever(w, a, p[:, j]) for j in range(4)], axis=1)  # (K, 4, 3, N)
    u = z.T[None] + lever[:, 0]
    columns = np.concatenate([u[:, None], lever[:, 1:]], axis=1)
    # steps of each column beyond the effect of turning; then those of the bias
    middle, by = 0.5 * (columns[..., 1:] + columns[..., :-1]), 0.5 * step * (w[..., 1:] + w[..., :-1])
    turned = _crossed(by[:, None], middle)
    steps = np.diff(columns, axis=-1) + turned
    biases = np.stack([-step * _crossed(axis[:, None], middle[:, 0]) for axis in np.eye(3)], axis=1)
    ages = grid[2:] - grid[-1]
    weight = np.exp(ages / HIGH_PASS_S)
    rows = np.cumsum(weight * np.concatenate([steps, biases], axis=1), axis=-1) / weight
    rows = rows.reshape(len(matrices), 7, -1)
    products = np.einsum("kin,kjn->kij", rows, rows)
    made = np.cumsum(weight * np.stack([turned[:, 0], np.diff(lever[:, 0], axis=-1)]), axis=-1) / weight
    size = float(np.sum(read[0] ** 2)) + 1e-6 * len(grid)
    down, across = z.mean(axis=0), np.linalg.norm(np.cross(z, read[0]), axis=1).sum()
    along = np.linalg.norm(read[0], axis=1).sum() * np.linalg.norm(down)
    return _Residuals(
        products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:], rows.shape[2], float(end - begin),
        np.sum(made**2, axis=(0, 2, 3)),
        np.sum((w - w[:1]) ** 2, axis=(1, 2)) / size,
        float(np.sqrt(gap / 2.0) / step**1.5),
        bool(across < 0.3 * along), float(np.linalg.norm(step * np.sum(read[0], axis=0))),
    )  # fmt: skip


def _residuals(parts: Sequence[_Residuals], variance: float, *, rested: bool) -> tuple[Floats, Floats, Floats]:
    """Return penalised residuals (K,), those allowed by noise and mistuning (K,) [m2/s4], and biases (K, 3) [rad/s]."""
    rows, span = sum(part.rows for part in parts), sum(part.span for part in parts)
    bias = _BIAS_AT_REST if rested else _BIAS
    cost = variance * rows / (_ROWS_PER_S * span) / np.repeat([_LEVER_M, bias], 3) ** 2
    unknowns = np.sum([part.unknowns for part in parts], axis=0) + np.diag(cost)
    against = np.sum([part.against for part in parts], axis=0)
    solved = np.linalg.solve(unknowns, against[..., None])[..., 0]
    residuals = np.sum([part.squares for part in parts], axis=0) - np.sum(against * solved, axis=1)
    levers = np.einsum("ki,kij,kj->k", solved[:, :3], unknowns[:, :3, :3], solved[:, :3])
    return (
        residuals,
        rows * variance + _MISTUNING_SHARE**2 * (np.sum([part.turned for part in parts], axis=0) + levers),
        -solved[:, 3:],
    )


def _at(grid: Floats, times: Floats, sums: Floats) -> Floats:
    return np.column_stack([np.interp(grid, times, sums[:, j]) for j in range(3)])


def _lever(w: Floats, a: Floats, p: Floats) -> Floats:
    """Return alpha x p + omega x (omega x p) for each variant and row, (K, 3, N)."""
    q = p[:, None]
    return _crossed(a, q) + w * np.einsum("kin,i->kn", w, p)[:, None] - q * np.sum(w * w, axis=1, keepdims=True)


def _crossed(a: Floats, b: Floats) -> Floats:
    """Return cross products of vectors (..., 3, N), ten times as fast as NumPy's."""
    (x, y, z), (u, v, w) = np.moveaxis(a, -2, 0), np.moveaxis(b, -2, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-2)


class TurningWatch:
    """Check a gyroscope against gravity, repeatedly over the last seconds of samples.

    A gyroscope that was found wrong stays wrong until a turn shows that it is right.
    """

    INTERVAL_S = 0.1  # [s] between comparisons
    SPANS = (0.8, 4.0)  # [s] of data: short for fast detection, long for small faults
    GAP = 0.2  # [s] without samples, after which the sums restart

    def __init__(self, place: Floats, drift: float, *, checked: bool = False) -> None:
        """Set the sensor's place and the base's drift, as of `compare`, and if a tumble has confirmed the gyroscope."""
        self._place, self._drift = place, drift
        self.result, self.may_be_used = Result(is_right=checked), checked
        self.fitted_bias: Floats | None = None  # (3,) [rad/s] fitted in recent turns
        self._was_right = checked
        self.bias: Floats | None = None  # (3,) of the gyroscope [rad/s], once measured at rest
        self._sums = {kind: deque[tuple[float, ...]](maxlen=int(self.SPANS[-1] / _SUM_SPACING_S) + 1) for kind in "gw"}
        self._last: dict[str, tuple[float, Floats, Floats]] = {}  # stamp, sample and sum
        self._compared = self._right_since = -math.inf

    def mistaken(self, gravity: Floats) -> float:
        """Return the error of gravity (3,) [m/s2] if the accelerometer's axes have changed, not the gyroscope's.

        It is 0 unless the gyroscope was confirmed before: the accelerometer is trusted first.
        """
        if (
            not self._was_right
            or self.result.matrix is None
            or self.result.fault not in (Fault.RATE_SIGN, Fault.RATE_AXES)
        ):
            return 0.0
        return float(np.linalg.norm(gravity - gravity @ self.result.matrix))

    def doubt(self) -> None:
        """Withdraw a confirmation after a jump of rates that no base can make."""
        if self.result.fault is Fault.NONE:
            self.result, self.may_be_used = Result(), False

    def _add(self, kind: str, stamp: float, vector: Floats) -> None:
        sums, before = self._sums[kind], self._last.get(kind)
        if before is None or not 0.0 < stamp - before[0] < self.GAP:
            sums.clear()
            total = np.zeros(3)
        else:
            total = before[2] + 0.5 * (stamp - before[0]) * (vector + before[1])
        self._last[kind] = stamp, vector, total
        if not sums or stamp - sums[-1][0] >= _SUM_SPACING_S:
            sums.append((stamp, *total.tolist()))

    def add_rate(self, stamp: float, rate: Floats) -> None:
        """Add a rate (3,) [rad/s] in the sensor's axes."""
        self._add("w", stamp, rate)

    def add_gravity(self, stamp: float, gravity: Floats, noise: tuple[float, float]) -> None:
        """Add gravity (3,) [m/s2] in the sensor's axes, with the noise of `compare`, and compare every `INTERVAL_S`."""
        self._add("g", stamp, gravity)
        if stamp - self._compared < self.INTERVAL_S or len(self._sums["w"]) < _MIN_ROWS:
            return
        self._compared = stamp
        forces, turns = (np.array(self._sums[kind]) for kind in "gw")
        for span in self.SPANS:
            begin = max(stamp - span, self._right_since)
            late, turned = (rows[np.searchsorted(rows[:, 0], begin) :] for rows in (forces, turns))
            if min(len(late), len(turned)) < _MIN_ROWS:
                continue
            drifted = 0.0 if self.bias is None else turned[:, :1] * self.bias
            motion = SensedTurn(late[:, 0], late[:, 1:], turned[:, 0], turned[:, 1:] - drifted)
            comparison = compare(
                [motion], self._place, drift=self._drift, noise=noise, rested=self.bias is not None, before=self.result
            )
            if span == self.SPANS[-1] and comparison.bias is not None:
                known = comparison.bias if self.fitted_bias is None else self.fitted_bias
                self.fitted_bias = known + self.INTERVAL_S / _BIAS_S * (comparison.bias - known)
            self.may_be_used |= comparison.is_unopposed and self.result.fault is Fault.NONE
            if comparison.is_right:
                if self.result.fault is not Fault.NONE:
                    self._right_since = begin  # earlier samples are of a wrong gyroscope
                self.result, self.may_be_used, self._was_right = comparison, True, True
            elif comparison.fault is not Fault.NONE:
                self.result, self.may_be_used = comparison, False
                return
