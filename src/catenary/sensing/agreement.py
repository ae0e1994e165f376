"""Do accelerometer and gyroscope agree: gravity, seen from axes that turn, changes by dg/dt = -omega x g.

What is wrong between the two shows as soon as the base turns about anything but the vertical: signs and order of axes,
unit, scale, and delay. Which of them is wrong cannot be told of the two alone; an accelerometer is judged at rest, so
the gyroscope is named.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import islice, permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.sensing.checks import CHEAP_NOISE, Fault, SensorRules, norm

_HIGH_PASS_S = 0.5  # [s] over which what is slower than turning is forgotten, of gravity and of what rates make of it
_RATE_HZ = 50.0  # rows of a comparison a second, at most
_FEWEST = 8  # samples that tell anything
# What may go beside a turn, and what each costs. Where something is found right or wrong, a bias of 0.05 rad/s costs as
# much as 0.3 m/s2 that nothing explains, and 0.1 m/s2 in favour of a gyroscope as it is; an axis of turning 0.3 m away
# 0.3 m/s2. Seen from far above that axis, as on a base that rocks about its feet, gravity moves more than it turns, and
# in step: where it does, 1.3 m cost as much. From below it moves less, which bases that hang do and little else: 0.1 m.
_BIAS_COST, _BIAS_COST_AS_IS, _FIRM, _LOOSE, _HANGING = 40.0, 4.0, 1.0, 0.05, 9.0
_BIAS_KNOWN = 400.0  # in place of both, of a gyroscope whose bias was seen at rest
_EXPLAINS = 0.15  # share of what is left that other axes, units or scales must leave at most, beyond noise
_NOISE = 3.0 * CHEAP_NOISE**2  # [m2/s4]
_AGREES = 0.3  # share of gravity's change that rates leave which agree with it
_STILL = 0.15  # share of a limit that gravity moves by at least where anything can be told
_FITS = 0.75  # least share of its own turning by which gravity turns with a gyroscope that helps
_AS_WELL = 1.6  # what a gyroscope leaves as it is, of what the best axes and unit leave: right ones left up to 1.42
_FEEBLE = 0.003  # [m2/s4 s] of turning that noise alone may seem to follow
_REST_RESIDUAL = 0.1  # [m2/s4 s] that a base leaves which has no accelerations of its own
_OFF_SCALE = 1.15  # beyond which a scale is wrong
TURNTABLE_SHARE = (
    0.5  # share of the rate about the horizontal below which it is a turntable, on which gravity leans outwards
)
_LEAST_SCALE = 0.5  # below which rates are worse than none
_MOST_SCALE = 5.0  # beyond which it is none: a gyroscope with a bias, and no more, seems to turn with anything
_SWUNG = 6  # samples over which a rate and its change are told
_APART = 0.0095  # [s] of samples that are kept: a hundred a second
_DELAYS = (-0.2, -0.15, -0.1, -0.06, -0.03, 0.03, 0.06, 0.1, 0.15, 0.2)  # [s]
_LATE_SEEMS = Fault.RATE_SCALE | Fault.RATE_SIGN | Fault.RATE_CONTRADICTS
_LATE_FROM = 2.0  # [s] of samples that tell a delay
_TURNED = slice(0, 9)  # columns: turning about axis i as the gyroscope's axis j reads it
_BIAS, _AXIS, _GRAVITY = slice(9, 12), slice(12, 15), 15  # a bias, where the axis of turning is, and what it makes
_BESIDE = slice(9, 15)
_SIZE = 16


def _axes() -> list[Floats]:
    """Return all ways to order three axes with signs, the plainest first: those that drivers have, then few changes."""
    ways = [
        np.eye(3)[list(p)] * np.array(s)[:, None] for p in permutations(range(3)) for s in product((1, -1), repeat=3)
    ]
    usual = [np.eye(3), np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), -np.eye(3)]

    def rank(way: Floats) -> tuple[int, int, int]:
        known = next((k for k, each in enumerate(usual) if (each == way).all()), len(usual))
        return known, int(np.sum(np.diag(way) == 0.0)), int(np.sum(way < 0.0))

    return sorted(ways, key=rank)


_AXIS_ORDERS = _axes()
_UNITS = {1.0: "", math.pi / 180.0: "it seems to be in deg/s", 180.0 / math.pi: "it seems to be divided by 57.3"}
_CANDIDATES = [(way, unit) for unit in _UNITS for way in _AXIS_ORDERS]
# as they may be read where the sensor's place was told, and makes more of them than a column can say
_SCALES = (1.3, 0.77, 1.7, 0.6, 2.5, 0.4, 5.0, 0.2)
_AT_ORIGIN = [_CANDIDATES[0], *((np.eye(3), scale) for scale in _SCALES), *_CANDIDATES[1 : len(_AXIS_ORDERS)]]
_AT_ORIGIN += [(np.eye(3), unit) for unit in _UNITS if unit != 1.0]
_WAYS = np.array([scale * way for way, scale in _AT_ORIGIN])
_HARMLESS = 0.2  # share of a limit that a gyroscope leaves at the origin which does no harm there
_LEVER_NOISE = 0.01  # [1/s4] that a cheap gyroscope's noise makes of a lever of a metre
_ROW_S = 0.04  # [s] between rows of that comparison
_FLAT = np.array([np.r_[unit * way.ravel(), -1.0] for way, unit in _CANDIDATES])


Row = tuple[float, float, float, float]  # stamp [s] and vector
Piece = tuple[Floats, Floats, Floats, Floats]  # arguments of `evidence`


class Agreement(NamedTuple):
    """What a comparison found."""

    fault: Fault  # of the gyroscope; NONE also where nothing can be told
    agrees: bool  # it turns as gravity does, for certain
    remedy: str = ""  # what mends it, in words
    readings: NDArray[np.bool_] | None = None  # of its axes and unit, among all that there are, that would agree
    may_be_late: bool = False  # something is left that a delay may explain
    # gravity turns with it, about as far or farther: it does more good than harm; None where nothing can be told, by so
    # little that a base moves by itself as far
    fits: bool | None = False
    beaten: float = 0.0  # what it leaves unexplained, of what other axes or another unit leave


def integrated(times: Floats, rates: Floats) -> Floats:
    """Return the integral of rates (M, 3) [rad/s] at times (M,) [s] since the first, (M, 3) [rad]."""
    steps = 0.5 * np.diff(times)[:, None] * (rates[1:] + rates[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def evidence(
    times: Floats, gravity: Floats, rate_times: Floats, angles: Floats, delay: float = 0.0, place: Floats | None = None
) -> Floats:
    """Return the products of all that may explain how gravity changed (16, 16), [m2/s4] times seconds; they add up.

    Gravity and the turning of it by rates, g x omega, go through the same high-pass. Samples (N,) and (M,) [s],
    gravity (N, 3) [m/s2] and integrated rates (M, 3) [rad] are in the same axes, those of the sensor; the rates are
    taken as `delay` [s] late. Gravity is that at the sensor or, by these rates, at the origin from which the sensor is
    at `place` (3,) [m].
    """
    total = np.zeros((_SIZE, _SIZE))
    inside = (times >= rate_times[0] - delay) & (times <= rate_times[-1] - delay)
    t, g = times[inside], gravity[inside]
    step = max(1, int(len(t) / max((t[-1] - t[0]) * _RATE_HZ, 1.0))) if len(t) > 1 else 1
    t, g = t[::step], g[::step]
    if len(t) < _FEWEST:
        return total
    angle = np.column_stack([np.interp(t + delay, rate_times, angles[:, j]) for j in range(3)])
    dt, by = np.diff(t), np.diff(angle, axis=0)
    rate = by / dt[:, None]
    alpha, omega = np.diff(rate, axis=0) / dt[1:, None], 0.5 * (rate[1:] + rate[:-1])
    outwards = omega[:, :, None] * omega[:, None, :] - np.sum(omega**2, axis=1)[:, None, None] * np.eye(3)
    along = _times_axes(alpha)
    if place is not None:
        g = g + np.pad((along + outwards) @ place, ((1, 1), (0, 0)), mode="edge")
    middle = 0.5 * (g[1:] + g[:-1])
    steps = np.zeros((len(dt), 3, _SIZE))
    steps[:, :, _BIAS] = _times_axes(middle)
    steps[:, :, _TURNED] = (steps[:, :, _BIAS, None] * by[:, None, None, :]).reshape(-1, 3, 9)
    steps[:, :, _BIAS] *= dt[:, None, None]
    steps[2:, :, _AXIS] = np.diff(along, axis=0)
    steps[:, :, _GRAVITY] = np.diff(g, axis=0)
    weight = np.exp((t[1:] - t[-1]) / _HIGH_PASS_S)[:, None, None]
    rows = np.cumsum(weight * steps, axis=0) / weight * np.sqrt(dt)[:, None, None]
    flat = rows.reshape(-1, _SIZE)
    total += flat.T @ flat
    return total


def judge(
    found: Floats, span: float, limit: float, doubted: NDArray[np.bool_] | None = None, *, rested: bool = False
) -> Agreement:
    """Judge a gyroscope by `evidence` over a span [s].

    limit [m2/s4 s] is what a base's own accelerations leave. One of which other readings were found to agree,
    `doubted`, agrees where none of these does. Of one that was seen at rest the bias is known.
    """
    bias, as_is = (_BIAS_KNOWN, _BIAS_KNOWN) if rested else (_BIAS_COST, _BIAS_COST_AS_IS)
    plain = _left_by(found, _BIAS, np.full(3, bias * span))
    beside = [_left_by(found, _BESIDE, np.repeat([as_is, cost], 3) * span) for cost in (_FIRM, _LOOSE, _HANGING)]
    firm, loose, hanging = (float(_FLAT[0] @ each @ _FLAT[0]) for each in beside)
    others = float(np.sum((_FLAT @ beside[0]) * _FLAT, axis=1).min())
    beaten = firm / (others + 0.02 * limit)
    moved = float(found[_GRAVITY, _GRAVITY])
    left = np.sum((_FLAT @ plain) * _FLAT, axis=1)
    shows, hidden = _STILL * limit, _STILL * (limit - _REST_RESIDUAL)
    turned = _FLAT[0][:9]
    claimed = float(turned @ plain[:9, :9] @ turned)
    scale = float(turned @ plain[:9, 9]) / max(claimed, 1e-12)
    fits = None if claimed < hidden else beaten < _AS_WELL and scale > _FITS and claimed > _FEEBLE
    if doubted is not None:
        fits = False
    if moved < shows:
        kind = Fault.RATE_CONTRADICTS if hanging > 1.5 * moved + limit else Fault.NONE
        return Agreement(kind, agrees=False, fits=fits)
    is_off = not 1.0 / _OFF_SCALE < scale < _OFF_SCALE
    if (
        beaten < _AS_WELL
        and not is_off
        and left[0] < _AGREES * moved
        and (doubted is None or left[doubted].min() - left[0] > shows)
    ):
        return Agreement(Fault.NONE, agrees=True, may_be_late=loose > limit, fits=True)
    scaled = np.r_[scale * turned, -1.0]
    off = float(scaled @ plain @ scaled)
    # of all that explain it about as well, the plainest; a scale alone may do better
    alike = left <= 1.2 * left.min() + 0.02 * limit
    best = int(np.argmax(alike))
    explained = left[best] < _EXPLAINS * min(firm, moved) and left[best] < 2.0 * off + 0.1 * limit
    if best > 0 and explained and firm - left[best] > limit:
        kind, remedy = _mended(*_CANDIDATES[best])
        return Agreement(kind, agrees=False, remedy=remedy, readings=alike)
    unmended = hanging if scale < _LEAST_SCALE else loose
    is_off &= 1.0 / _MOST_SCALE < abs(scale) < _MOST_SCALE
    noise = _NOISE * span
    if is_off and off - noise < _EXPLAINS * (min(unmended, moved) - noise) and unmended - off > limit:
        kind = Fault.RATE_SCALE if scale > 0.0 else Fault.RATE_SIGN
        said = f"gravity turns {scale:.3g} times as far as it says"
        return Agreement(kind, agrees=False, remedy=said)
    if loose > 1.5 * moved + limit:
        return Agreement(Fault.RATE_CONTRADICTS, agrees=False, may_be_late=True)
    return Agreement(Fault.NONE, agrees=False, may_be_late=loose > limit, fits=fits, beaten=beaten)


def compare(
    pieces: Sequence[Piece],
    limit: float,
    doubted: NDArray[np.bool_] | None = None,
    *,
    rested: bool = False,
    place: Floats | None = None,
) -> Agreement:
    """Compare a gyroscope with an accelerometer over pieces of time, as those between the rests of a tumble.

    One that helps does so also at the base's origin, from which the sensor is at `place` (3,) [m] in its own axes: what
    a wrong scale and a lever make together may look right at the sensor.
    """
    span = sum(float(times[-1] - times[0]) for times, *_ in pieces)
    if not span > 0.0:
        return Agreement(Fault.NONE, agrees=False)
    total = sum((evidence(*piece) for piece in pieces), np.zeros((_SIZE, _SIZE)))
    found = judge(total, span, limit, doubted, rested=rested)
    if place is not None:
        total = sum((evidence(*piece, place=place) for piece in pieces), np.zeros((_SIZE, _SIZE)))
        there = judge(total, span, limit, doubted, rested=rested)
        seen = max(found.beaten, there.beaten)
        if found.fits and there.fits:
            return (there if there.agrees else found)._replace(beaten=seen)
        left = np.sum([_left_at_origin(*piece, place) for piece in pieces], axis=0)
        noise = 0.02 * limit + _LEVER_NOISE * span * float(place @ place)
        best = int(np.argmax(left <= 1.2 * left.min() + noise))  # of those about as good, the plainest
        if left[best] < _EXPLAINS * left[0] and left[0] - left[best] > limit:
            return _accused(*_AT_ORIGIN[best])
        beaten = float(left[0] / (left.min() + noise))
        is_explained = beaten < _AS_WELL and there.fault is Fault.NONE
        is_explained &= there.fits is not False or left[0] < _HARMLESS * limit + noise
        if is_explained and (there.agrees or found.fault is not Fault.NONE or found.fits is False):
            found = there  # the place that was told explains what seems wrong at the sensor
        elif there.fits is False:
            found = found._replace(fits=False, agrees=False)
        found = found._replace(beaten=max(seen, beaten))
    if found.fault is Fault.RATE_CONTRADICTS and all(_is_upright(*piece) for piece in pieces):
        return Agreement(Fault.NONE, agrees=False)
    if not found.may_be_late or span < _LATE_FROM:
        return found
    inner: list[Piece] = []
    for times, gravity, rate_times, angles in pieces:
        kept = (times > times[0] + _DELAYS[-1]) & (times < times[-1] - _DELAYS[-1])
        inner.append((times[kept], gravity[kept], rate_times, angles))
    left = {}
    for delay in (0.0, *_DELAYS):
        total = sum((evidence(*piece, delay) for piece in inner), np.zeros((_SIZE, _SIZE)))
        left[delay] = float(_FLAT[0] @ _left_by(total, _BIAS, np.full(3, _BIAS_COST * span)) @ _FLAT[0])
    best = min(left, key=lambda delay: left[delay])
    if best != 0.0 and left[best] < _AGREES * left[0.0] and left[0.0] - left[best] > limit:
        side = "late" if best > 0.0 else "early"
        return Agreement(Fault.RATE_DELAY, agrees=False, remedy=f"its rates are about {1000 * abs(best):.0f} ms {side}")
    return found


def _left_at_origin(times: Floats, gravity: Floats, rate_times: Floats, angles: Floats, place: Floats) -> Floats:
    """Return what each way to read the rates leaves of gravity's change at the origin, by its own lever (K,)."""
    rows = np.arange(max(times[0], rate_times[0]), min(times[-1], rate_times[-1]), _ROW_S)
    if len(rows) < _FEWEST:
        return np.zeros(len(_AT_ORIGIN))
    g, angle = (
        np.array([np.interp(rows, t, v[:, j]) for j in range(3)]) for t, v in ((times, gravity), (rate_times, angles))
    )
    by = np.diff(angle, axis=1)
    alpha, omega = np.diff(by, axis=1) / _ROW_S**2, 0.5 * (by[:, 1:] + by[:, :-1]) / _ROW_S
    swing, omega, by = _WAYS @ alpha, _WAYS @ omega, _WAYS @ by[:, 1:-1]  # (K, 3, rows)
    p = place[:, None]
    outwards = omega * (place @ omega)[:, None] - p * np.sum(omega**2, axis=1)[:, None]
    there = g[:, 1:-1] + _crossed(swing, p[None]) + outwards
    left = np.diff(there, axis=2) - _crossed(0.5 * (there[:, :, 1:] + there[:, :, :-1]), by)
    weight = np.exp((rows[2:-1] - rows[-2]) / _HIGH_PASS_S)
    kept = np.cumsum(weight * left, axis=2) / weight
    return np.asarray(_ROW_S * np.sum(kept**2, axis=(1, 2)))


def _crossed(a: Floats, b: Floats) -> Floats:
    """Return cross products of vectors (..., 3, N); those of NumPy take ten times as long."""
    (x, y, z), (u, v, w) = np.moveaxis(a, -2, 0), np.moveaxis(b, -2, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-2)


def accelerations(rules: SensorRules, span: float) -> float:
    """Return what a base's own accelerations may leave over a span [s], to judge by [m2/s4 s]."""
    return _REST_RESIDUAL + 0.5 * min(rules.slow_acceleration, _HIGH_PASS_S * rules.slow_jerk) ** 2 * span


class AgreementWatch:
    """Compares the last seconds of two streams of samples now and then.

    A gyroscope that was found wrong is wrong until it agrees with the accelerometer in a turn that shows it.
    """

    EVERY = 0.1  # [s] between comparisons
    SPANS = (0.8, 4.0)  # [s] over which: the first finds what is new soon, the other what is small
    GAP = 0.2  # [s] without samples, after which both begin anew

    def __init__(self, rules: SensorRules, place: Floats, *, checked: bool = False) -> None:
        """Take rules, the sensor's place as `compare` does, and whether the gyroscope was found right before."""
        self._rules, self._place = rules, place if place.any() else None
        self.found = Agreement(Fault.NONE, agrees=False)
        self._gravity, self._angles = (deque[Row](maxlen=int(self.SPANS[-1] / _APART) + 1) for _ in range(2))
        self._angle, self._rate, self._rate_stamp = np.zeros(3), np.zeros(3), -math.inf
        self._compared = self._right_since = -math.inf
        self._proven = self.may_be_used = checked
        self.rested = False  # the gyroscope's bias was seen at rest

    def lever(self) -> float:
        """Return how far apart gravity at the sensor and at the origin may be by rates that are not used [m/s2]."""
        if self._place is None or len(self._angles) < 2 * _SWUNG:
            return 0.0
        rows = np.array(list(islice(reversed(self._angles), 2 * _SWUNG)))[:: _SWUNG - 1]
        rates = np.diff(rows[:, 1:], axis=0) / np.diff(rows[:, :1], axis=0)
        swing = (rates[0] - rates[1]) / (rows[0, 0] - rows[1, 0])
        return norm(self._place) * (norm(swing) + float(rates[0] @ rates[0]))

    def add_rate(self, stamp: float, rate: Floats) -> None:
        """Take a rate (3,) [rad/s] in the sensor's axes."""
        dt = stamp - self._rate_stamp
        if 0.0 < dt < self.GAP:
            self._angle = self._angle + 0.5 * dt * (rate + self._rate)
        else:
            self._angles.clear()
        self._rate, self._rate_stamp = rate, stamp
        _add(self._angles, stamp, self._angle)

    def add_gravity(self, stamp: float, gravity: Floats) -> None:
        """Take gravity (3,) [m/s2] in the sensor's axes, and compare now and then."""
        if self._gravity and not 0.0 < stamp - self._gravity[-1][0] < self.GAP:
            self._gravity.clear()
        _add(self._gravity, stamp, gravity)
        if stamp - self._compared < self.EVERY or not self._angles:
            return
        self._compared = stamp
        forces, turns = np.array(self._gravity), np.array(self._angles)
        fitted = True
        for span in self.SPANS:
            begin = max(stamp - span, self._right_since)
            late, turned = (rows[np.searchsorted(rows[:, 0], begin) :] for rows in (forces, turns))
            if min(len(late), len(turned)) < _FEWEST:
                fitted = False
                continue
            piece = late[:, 0], late[:, 1:], turned[:, 0], turned[:, 1:]
            limit = accelerations(self._rules, span)
            found = compare([piece], limit, self.found.readings, rested=self.rested, place=self._place)
            fitted &= found.fits is True
            self._proven &= found.beaten < _AS_WELL
            self.may_be_used = self._proven or found.fits is None
            is_short = span == self.SPANS[0]
            is_right = found.agrees and not (is_short and self.found.fault is Fault.RATE_DELAY)
            if is_short and found.fault is Fault.NONE and self.found.fault is Fault.RATE_CONTRADICTS:
                is_right |= found.fits is not False  # what contradicted, by other rates, does so no more
            if is_right:
                if not self.found.agrees:
                    self._right_since = begin  # what was before is of a gyroscope that was wrong, or not known
                self.found = found
            # what contradicts does so now; a while ago another may have
            elif found.fault is not Fault.NONE and (found.remedy or is_short):
                self._proven = self.may_be_used = False
                # what is late seems to be of another scale, or none, where a turn begins or ends
                if self.found.fault is not Fault.RATE_DELAY or found.fault not in _LATE_SEEMS:
                    self.found = found
                return
        self._proven |= fitted  # over all spans: a part of a turn shows no other axes
        self.may_be_used |= self._proven


def _add(recent: deque[Row], stamp: float, vector: Floats) -> None:
    """Take a sample (3,), unless one was taken just before."""
    if not recent or stamp - recent[-1][0] >= _APART:
        recent.append((stamp, *vector.tolist()))


def _is_upright(times: Floats, gravity: Floats, rate_times: Floats, angles: Floats) -> bool:
    """Return whether a base turned about the vertical, by and large: a turntable, on which gravity leans outwards."""
    down, by = gravity.mean(axis=0), np.diff(angles, axis=0)
    across, along = (np.linalg.norm(v, axis=-1).sum() for v in (np.cross(down, by), by))
    return bool(across < TURNTABLE_SHARE * along * np.linalg.norm(down))


def _times_axes(vectors: Floats) -> Floats:
    """Return vectors (N, 3) times x, y and z, the cross products in columns (N, 3, 3)."""
    x, y, z = vectors.T
    out = np.zeros((len(vectors), 3, 3))
    out[:, 1, 0], out[:, 2, 0], out[:, 0, 1], out[:, 2, 1], out[:, 0, 2], out[:, 1, 2] = z, -y, -z, x, y, -x
    return out


def _left_by(found: Floats, free: slice, cost: Floats) -> Floats:
    """Return what is left of products (10, 10) of turning and gravity once some columns explain what they can."""
    kept = np.r_[0:9, _GRAVITY]
    A, B = found[free, free] + np.diag(cost), found[free][:, kept]
    return found[np.ix_(kept, kept)] - B.T @ np.linalg.solve(A, B)


def _accused(way: Floats, scale: float) -> Agreement:
    """Return that a gyroscope is wrong which another way to read it explains."""
    if scale in _SCALES:
        return Agreement(
            Fault.RATE_SCALE, agrees=False, remedy=f"gravity turns about {scale:g} times as far as it says"
        )
    kind, remedy = _mended(way, scale)
    return Agreement(kind, agrees=False, remedy=remedy)


def _mended(way: Floats, unit: float) -> tuple[Fault, str]:
    """Return what is wrong with a gyroscope that other axes or another unit explain, and what mends it."""
    kind = Fault.RATE_SIGN if (np.abs(way) == np.eye(3)).all() else Fault.RATE_AXES
    # as options have it: which of the sensor's axes gives x, y and z
    order = ",".join(("-" if row.sum() < 0.0 else "") + "xyz"[int(np.abs(row).argmax())] for row in way)
    axes = "" if (way == np.eye(3)).all() else f"its x, y, z seem to be {order}"
    return Fault.RATE_UNIT if unit != 1.0 else kind, ", and ".join(filter(None, (_UNITS[unit], axes)))
