"""Does gravity turn as a gyroscope says: explanations of what both read, which compete on the last seconds.

Seen from axes that turn by omega, gravity less the acceleration of an origin changes by du/dt = -omega x u, and a
sensor at a place L from a point that stays where it is reads u - alpha x L - omega x (omega x L). Each explanation is
a way to read the gyroscope: as it is, in other axes, another unit or scale, late, or telling nothing of the base. L and
the gyroscope's bias are unknowns of each, so that no place, told or not, condemns a right one.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.checks import Fault

_STEP_S, _LONG_STEP_S, _LONG_S = 0.01, 0.02, 1.0  # [s] of samples that a row is the mean of, and in long pieces
HIGH_PASS_S = 0.5  # [s] over which what is slower than turning is forgotten
_FEWEST = 8  # rows that tell anything
_APART_S = 0.0095  # [s] between sums that are kept
_LEVER_M = 0.5  # [m] standard deviation of the place that a base turns about
_BIAS, _BIAS_AT_REST = 0.05, 0.005  # [rad/s] of a gyroscope's bias, and where it was seen at rest
_NOISE = 0.03  # [m/s2] that may be left beside noise
_MISTUNED = 0.04  # of what turning makes: scales and axes of a cheap sensor that is right
_ROWS_PER_S = 12.0  # independent numbers in a second of rows
_BIAS_S = 10.0  # [s] over which a bias that was fitted in turns is averaged
_CONFIRMS, _ACCUSES = (
    3.0,
    6.0,
)  # [nats] by which a gyroscope beats others, and by which another beats it beyond its price
_DIFFERS = 0.35  # of the rate by which another way to read it must differ to count
_FITS = 1.5  # times what noise and mistuning may leave, below which nothing is left to explain
_FAR_WORSE = 25.0  # times what a gyroscope that tells nothing leaves: what is right never leaves so much
_SHOWN_TURN = 0.1  # [rad] about the vertical by rates that nothing opposes


class Way(NamedTuple):
    """A way to read a gyroscope: true rate = matrix @ rate, `late` [s] before its stamp."""

    matrix: Floats
    late: float = 0.0


@dataclass(frozen=True, eq=False)
class RateExplanation:
    """What may be wrong with a gyroscope, how it may be read then, what it costs to say so, and what mends it."""

    fault: Fault
    ways: Sequence[Way]
    price: float  # [nats]
    remedy: Callable[[Way], str]


def _order_of(way: Way) -> str:
    """Return a signed order of axes as options have it: which of the sensor's axes give x, y and z."""
    order = ("-" * int(row.sum() < 0.0) + "xyz"[int(np.abs(row).argmax())] for row in way.matrix)
    return f"its x, y, z seem to be {','.join(order)}"


def _scale_of(way: Way) -> str:
    return f"gravity turns {way.matrix[0, 0]:.3g} times as far as it says"


def _lateness_of(way: Way) -> str:
    return f"its rates are about {1000.0 * abs(way.late):.0f} ms {'late' if way.late > 0.0 else 'early'}"


_ORDERS = [
    Way(np.eye(3)[list(p)] * np.array(s)[:, None]) for p in permutations(range(3)) for s in product((1, -1), repeat=3)
]
# half of an aircraft's axes are what drivers mix up most
_SIGN_PRICE = 0.3  # [nats] of each sign that is turned
_USUAL = [np.diag([1.0, -1.0, -1.0]), -np.eye(3), np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])]
_SCALES = np.r_[np.geomspace(0.1, 0.8, 7), np.geomspace(1.25, 10.0, 7), -1.0]
EXPLANATIONS = (
    RateExplanation(Fault.NONE, [_ORDERS[0]], 0.0, lambda way: ""),
    RateExplanation(Fault.RATE_CONTRADICTS, [Way(np.zeros((3, 3)))], 2.0, lambda way: ""),
    RateExplanation(Fault.RATE_SIGN, _ORDERS[1:8], 3.7, _order_of),
    RateExplanation(Fault.RATE_AXES, _ORDERS[8:], 5.0, _order_of),
    RateExplanation(Fault.RATE_UNIT, [Way(np.radians(np.eye(3)))], 3.0, lambda way: "it seems to be in deg/s"),
    RateExplanation(Fault.RATE_UNIT, [Way(np.degrees(np.eye(3)))], 3.0, lambda way: "it seems to be divided by 57.3"),
    RateExplanation(Fault.RATE_SCALE, [Way(s * np.eye(3)) for s in _SCALES[:-1].tolist()], 5.0, _scale_of),
    RateExplanation(
        Fault.RATE_DELAY, [Way(np.eye(3), s) for s in (-0.2, -0.15, -0.1, -0.06, -0.03, 0.03, 0.06, 0.1, 0.15, 0.2)],
        5.0, _lateness_of,
    ),
)  # fmt: skip
_WAYS = [(record, way) for record in EXPLANATIONS for way in record.ways]
_MATRICES = np.array([way.matrix for _, way in _WAYS])
# of ways that explain alike the plainest: one that drivers have, then few signs
_PRICES = np.array([record.price - 1.0 * any((way.matrix == m).all() for m in _USUAL) for record, way in _WAYS])
_PRICES += _SIGN_PRICE * np.sum(_MATRICES < 0.0, axis=(1, 2))
_LATE = np.array([way.late for _, way in _WAYS])
# shares of the prices that count where a gyroscope is to be confirmed: what is gradual, a scale or a lateness, can
# hardly be told from a place that turns
_BELIEF = np.array([0.8 if record.fault in (Fault.RATE_SCALE, Fault.RATE_DELAY) else 0.5 for record, _ in _WAYS])


class Found(NamedTuple):
    """What a comparison found."""

    fault: Fault = Fault.NONE  # of the gyroscope; NONE also where nothing can be told
    is_right: bool = False  # it turns as gravity does, and nothing else explains that as well
    is_unopposed: bool = False  # it turns about the vertical, and gravity says nothing against it
    remedy: str = ""  # what mends it, in words
    ways: tuple[int, ...] = ()  # of all to read it, those that mend it about as well
    bias: Floats | None = None  # (3,) [rad/s] of the gyroscope as it is
    matrix: Floats | None = None  # (3, 3) by which its rates, or the accelerometer's readings, are in other axes


class SensedTurn(NamedTuple):
    """Sums since a begin: times (N,) [s], integrals of gravity (N, 3), and the same of rates, in the sensor's axes."""

    times: Floats
    gravity: Floats
    rate_times: Floats
    angles: Floats


class _Part(NamedTuple):
    """What is left of a piece by each way (K): products of rows, of rows with unknowns, and of unknowns."""

    squares: Floats  # (K,)
    against: Floats  # (K, 6)
    unknowns: Floats  # (K, 6, 6)
    rows: int
    span: float  # [s]
    turned: Floats  # (K,) squares of what turning makes, and of the told lever
    differs: Floats  # (K,) by how much of the rate each differs from it as it is, squared
    swing: float  # [1/s] of angular acceleration, that a rate's noise of one makes
    is_upright: bool  # it turns about the vertical, by and large
    angle: float  # [rad] that it turned in all


def integral(times: Floats, values: Floats) -> Floats:
    """Return the integral of values (N, 3) over times (N,) since the first, (N, 3)."""
    steps = 0.5 * np.diff(times)[:, None] * (values[1:] + values[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def compare(
    pieces: Sequence[SensedTurn],
    place: Floats,
    *,
    drift: float = 0.0,
    noise: tuple[float, float] = (0.0, 0.0),
    rested: bool = False,
    before: Found = Found(),  # noqa: B008  # immutable
) -> Found:
    """Compare all explanations of pieces of time.

    place (3,) [m] is the sensor's from the base's origin, in its axes. A base's own accelerations drift by `drift`
    [m/s2] in the rows; of a gyroscope that was seen at rest the bias is known; `noise` is of a sample of gravity and of
    a rate [m/s2, rad/s]. A gyroscope that was found wrong `before` is held against what mended it.
    """
    parts = _parts(pieces, place, _MATRICES[:2], _LATE[:2])  # as it is, and telling nothing
    if not parts:
        return Found()
    swing = max(part.swing for part in parts) * noise[1] * float(np.linalg.norm(place))  # that noise makes of the lever
    variance = _NOISE**2 + drift**2 + (0.5 * noise[0]) ** 2 + swing**2
    is_upright = all(part.is_upright for part in parts) and max(part.angle for part in parts) > _SHOWN_TURN
    left, floor, biases = _explained(parts, variance, rested=rested)
    fits = left[0] < min(_FITS * floor[0], _FAR_WORSE * max(left[1], floor[1]))
    if fits and (before.is_right or is_upright or (left < _FITS * floor[1]).all()):
        return Found(is_unopposed=is_upright, bias=biases[0])
    parts = _parts(pieces, place, _MATRICES, _LATE)
    left, floor, biases = _explained(parts, variance, rested=rested)
    cost = 0.5 * _ROWS_PER_S * sum(part.span for part in parts) * np.log(left + floor)
    gains = cost[0] - cost  # of each beyond the gyroscope as it is [nats]
    best = int(np.argmax(gains - _PRICES))
    record, way = _WAYS[best]
    if gains[best] - _PRICES[best] > _ACCUSES:
        if record.fault is Fault.RATE_SCALE:
            near = np.geomspace(0.75, 1.34, 31)[:, None, None] * way.matrix
            refined = _parts(pieces, place, near, np.zeros(31))
            way = Way(near[int(np.argmin(_explained(refined, variance, rested=rested)[0]))])
        alike = [k for k, (other, _) in enumerate(_WAYS) if other is record and gains[k] > gains[best] - _CONFIRMS]
        return Found(record.fault, remedy=record.remedy(way), ways=tuple(alike), matrix=way.matrix)
    counts = np.sum([part.differs for part in parts], axis=0) > _DIFFERS**2 * len(parts)
    rivals = gains - _BELIEF * _PRICES
    is_right = counts.any() and (rivals[counts] < -_CONFIRMS).all()
    if before.fault is not Fault.NONE:  # it is right again where what mended it does so no more
        is_right = (gains[list(before.ways)] < -_CONFIRMS).all() and left[0] < _FITS * floor[0]
    return Found(is_right=bool(is_right), bias=biases[0] if is_right else None)


def _parts(pieces: Sequence[SensedTurn], place: Floats, matrices: Floats, late: Floats) -> list[_Part]:
    found = [_left(piece, place, matrices, late) for piece in pieces]
    return [part for part in found if part is not None]


def _left(piece: SensedTurn, place: Floats, matrices: Floats, late: Floats) -> _Part | None:
    """Return what is left of a piece by each way; None of one that is too short."""
    begin, end = max(piece.times[0], piece.rate_times[0]), min(piece.times[-1], piece.rate_times[-1])
    gap = float(np.median(np.diff(piece.times)))
    step = max(_LONG_STEP_S if end - begin > _LONG_S else _STEP_S, 1.01 * gap)
    grid = np.arange(begin, end, step)
    if len(grid) < _FEWEST + 2:
        return None
    z = np.diff(_at(grid, piece.times, piece.gravity), axis=0) / step
    rates = {s: np.diff(_at(grid + s, piece.rate_times, piece.angles), axis=0) / step for s in set(late.tolist())}
    read = np.array([rates[s] for s in late.tolist()])  # (K, N, 3)
    w = np.einsum("kij,knj->kin", matrices, read)
    a = np.gradient(w, step, axis=2)
    p = np.concatenate([place[:, None], np.eye(3)], axis=1)  # the place, and unknowns beside it
    lever = np.stack([_lever(w, a, p[:, j]) for j in range(4)], axis=1)  # (K, 4, 3, N)
    u = z.T[None] + lever[:, 0]
    columns = np.concatenate([u[:, None], lever[:, 1:]], axis=1)
    # steps of each beyond what turning makes of it; then those of the bias
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
    return _Part(
        products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:], rows.shape[2], float(end - begin),
        np.sum(made**2, axis=(0, 2, 3)),
        np.sum((w - w[:1]) ** 2, axis=(1, 2)) / size,
        float(np.sqrt(gap / 2.0) / step**1.5),
        bool(across < 0.3 * along), float(np.linalg.norm(step * np.sum(read[0], axis=0))),
    )  # fmt: skip


def _explained(parts: Sequence[_Part], variance: float, *, rested: bool) -> tuple[Floats, Floats, Floats]:
    """Return what each way leaves, the unknowns' costs counted, and what noise and mistuning may leave (K,) [m2/s4].

    And the bias that each finds (K, 3) [rad/s].
    """
    rows, span = sum(part.rows for part in parts), sum(part.span for part in parts)
    bias = _BIAS_AT_REST if rested else _BIAS
    cost = variance * rows / (_ROWS_PER_S * span) / np.repeat([_LEVER_M, bias], 3) ** 2
    unknowns = np.sum([part.unknowns for part in parts], axis=0) + np.diag(cost)
    against = np.sum([part.against for part in parts], axis=0)
    solved = np.linalg.solve(unknowns, against[..., None])[..., 0]
    left = np.sum([part.squares for part in parts], axis=0) - np.sum(against * solved, axis=1)
    levers = np.einsum("ki,kij,kj->k", solved[:, :3], unknowns[:, :3, :3], solved[:, :3])
    return (
        left,
        rows * variance + _MISTUNED**2 * (np.sum([part.turned for part in parts], axis=0) + levers),
        -solved[:, 3:],
    )


def _at(grid: Floats, times: Floats, sums: Floats) -> Floats:
    return np.column_stack([np.interp(grid, times, sums[:, j]) for j in range(3)])


def _lever(w: Floats, a: Floats, p: Floats) -> Floats:
    """Return alpha x p + omega x (omega x p) of each way and row, (K, 3, N)."""
    q = p[:, None]
    return _crossed(a, q) + w * np.einsum("kin,i->kn", w, p)[:, None] - q * np.sum(w * w, axis=1, keepdims=True)


def _crossed(a: Floats, b: Floats) -> Floats:
    """Return cross products of vectors (..., 3, N); those of NumPy take ten times as long."""
    (x, y, z), (u, v, w) = np.moveaxis(a, -2, 0), np.moveaxis(b, -2, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-2)


class TurningWatch:
    """Compares the last seconds of two streams of samples now and then.

    A gyroscope that was found wrong is wrong until it is right in a turn that shows it.
    """

    EVERY = 0.1  # [s] between comparisons
    SPANS = (0.8, 4.0)  # [s] over which: the first finds what is new soon, the other what is small
    GAP = 0.2  # [s] without samples, after which both begin anew

    def __init__(self, place: Floats, drift: float, *, checked: bool = False) -> None:
        """Take the sensor's place and a base's accelerations as `compare` does, and whether it was found right."""
        self._place, self._drift = place, drift
        self.found, self.may_be_used = Found(is_right=checked), checked
        self.fitted_bias: Floats | None = None  # (3,) [rad/s] in turns, of late
        self._was_right = checked
        self.bias: Floats | None = None  # (3,) of the gyroscope [rad/s], once it was seen at rest
        self._sums = {kind: deque[tuple[float, ...]](maxlen=int(self.SPANS[-1] / _APART_S) + 1) for kind in "gw"}
        self._last: dict[str, tuple[float, Floats, Floats]] = {}  # stamp, sample and sum
        self._compared = self._right_since = -math.inf

    def mistaken(self, gravity: Floats) -> float:
        """Return how far gravity (3,) is off if the accelerometer's axes have changed, and not the gyroscope's [m/s2].

        Of one that was never found right the accelerometer, which knows down, is believed.
        """
        if (
            not self._was_right
            or self.found.matrix is None
            or self.found.fault not in (Fault.RATE_SIGN, Fault.RATE_AXES)
        ):
            return 0.0
        return float(np.linalg.norm(gravity - gravity @ self.found.matrix))

    def doubt(self) -> None:
        """Take that rates have leapt as no base turns: what was found right before may be so no more."""
        if self.found.fault is Fault.NONE:
            self.found, self.may_be_used = Found(), False

    def _add(self, kind: str, stamp: float, vector: Floats) -> None:
        sums, before = self._sums[kind], self._last.get(kind)
        if before is None or not 0.0 < stamp - before[0] < self.GAP:
            sums.clear()
            total = np.zeros(3)
        else:
            total = before[2] + 0.5 * (stamp - before[0]) * (vector + before[1])
        self._last[kind] = stamp, vector, total
        if not sums or stamp - sums[-1][0] >= _APART_S:
            sums.append((stamp, *total.tolist()))

    def add_rate(self, stamp: float, rate: Floats) -> None:
        """Take a rate (3,) [rad/s] in the sensor's axes."""
        self._add("w", stamp, rate)

    def add_gravity(self, stamp: float, gravity: Floats, noise: tuple[float, float]) -> None:
        """Take gravity (3,) [m/s2] in the sensor's axes, and noise as `compare` does, and compare now and then."""
        self._add("g", stamp, gravity)
        if stamp - self._compared < self.EVERY or len(self._sums["w"]) < _FEWEST:
            return
        self._compared = stamp
        forces, turns = (np.array(self._sums[kind]) for kind in "gw")
        for span in self.SPANS:
            begin = max(stamp - span, self._right_since)
            late, turned = (rows[np.searchsorted(rows[:, 0], begin) :] for rows in (forces, turns))
            if min(len(late), len(turned)) < _FEWEST:
                continue
            drifted = 0.0 if self.bias is None else turned[:, :1] * self.bias
            motion = SensedTurn(late[:, 0], late[:, 1:], turned[:, 0], turned[:, 1:] - drifted)
            found = compare(
                [motion], self._place, drift=self._drift, noise=noise, rested=self.bias is not None, before=self.found
            )
            if span == self.SPANS[-1] and found.bias is not None:
                known = found.bias if self.fitted_bias is None else self.fitted_bias
                self.fitted_bias = known + self.EVERY / _BIAS_S * (found.bias - known)
            self.may_be_used |= found.is_unopposed and self.found.fault is Fault.NONE
            if found.is_right:
                if self.found.fault is not Fault.NONE:
                    self._right_since = begin  # what was before is of a gyroscope that was wrong
                self.found, self.may_be_used, self._was_right = found, True, True
            elif found.fault is not Fault.NONE:
                self.found, self.may_be_used = found, False
                return
