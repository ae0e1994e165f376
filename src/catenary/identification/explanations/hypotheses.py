"""Hypotheses about faults in a recording of torques (load, gain, sign, zero, delay), one record each.

A new hypothesis is a function that yields candidates, and a record in `HYPOTHESES`. The number of a candidate, if any,
is searched on a grid and then by parabolas, and the evidence is integrated about its maximum (Laplace's method). A
price is the negative log prior probability of a candidate, in nats.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.identification.explanations.evidence import Evidence, Extra
from catenary.identification.explanations.regressor_columns import Added, Supposed
from catenary.spatial import STANDARD_GRAVITY, angle_between
from catenary.units import TORQUE_UNIT

_Density = Callable[[float], float]


class Trial(NamedTuple):
    """Starting point of candidates: evidence, current supposition, and index of the belief's spread."""

    evidence: Evidence
    supposed: Supposed
    which: int

    def log(self, supposed: Supposed, extra: Sequence[Extra] = ()) -> float:
        """Return the log evidence of another supposition."""
        return self.evidence.log(supposed, self.which, extra)

    def cause(
        self, supposed: Supposed, says: str, joints: tuple[int, ...] = (), remedy: str = "", price: float = 0.0
    ) -> "PossibleCause":
        """Return a supposition without a number as a cause with a price [nats]."""
        return PossibleCause(supposed, self.log(supposed) - price, says, joints, remedy)

    def scaled(self, factors: Floats) -> Supposed:
        """Return the supposition with the gains of recorded torques multiplied by factors (n,)."""
        return replace(self.supposed, gains=tuple(np.array(self.supposed.gains) * factors))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.evidence.model.joint_names

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.evidence.model.n

    @property
    def moves(self) -> np.ndarray:
        """Flags (n,) of joints that move."""
        q = self.evidence.rows.samples.q
        return np.asarray(q.std(axis=0) > _LEAST_MOTION)


class PossibleCause(NamedTuple):
    """A possible explanation of a recording."""

    supposed: Supposed
    log_evidence: float  # under the trial's spread, integrated over the candidate's number
    says: str
    joints: tuple[int, ...] = ()
    remedy: str = ""  # its absence makes a note; {rates:...} marks options that apply if velocities were recorded
    error: float = 0.0  # relative error of the number, or degrees over 90; above a tenth no remedy is advised


@dataclass(frozen=True)
class Hypothesis:
    """A kind of explanation.

    Args:
        finding: Name in `FINDINGS` under which it is reported.
        price: Function from the number of joints to the price of each candidate [nats].
        by_masses: It can be detected only with known masses, from a file or identified.
        by_identification: It applies only to an identified arm.
    """

    name: str
    finding: str
    price: Callable[[int], float]
    candidates: Callable[[Trial], Iterator[PossibleCause]]
    by_masses: bool = False
    by_identification: bool = False


UNSURE = 0.1  # relative error of a number from which it is not advised
_LEAST_MOTION = 1e-3  # [rad, m] standard deviation of positions below which a joint stands still
_SEARCH_STEPS, _SEARCH_SHRINK, _SEARCH_TOLERANCE = 8, 2.5, 0.02


def _normal(std: float, mean: float = 0.0) -> _Density:
    return lambda x: -0.5 * ((x - mean) / std) ** 2 - float(np.log(std * np.sqrt(2.0 * np.pi)))


def _either(first: _Density, second: _Density) -> _Density:
    return lambda x: float(np.logaddexp(first(x), second(x)) - np.log(2.0))


def _integrated(log: _Density, grid: Floats, prior: _Density) -> tuple[float, float, float]:
    """Return the argument of the maximum of log + prior, the log integral, and the standard deviation about it."""

    def f(x: float) -> float:
        return log(x) + prior(x)

    values = [f(x) for x in grid]
    k = int(np.argmax(values))
    h = float(grid[1] - grid[0] if k == 0 else grid[k] - grid[k - 1])
    x, best, curvature = float(grid[k]), values[k], -1.0
    for _ in range(_SEARCH_STEPS):
        h /= _SEARCH_SHRINK
        left, right = f(x - h), f(x + h)
        bend = left + right - 2.0 * best
        curvature = bend / h**2
        step = (
            float(np.clip(0.5 * h * (left - right) / bend, -2.0 * h, 2.0 * h))
            if bend < 0.0
            else np.copysign(h, right - left)
        )
        best, x = max((best, x), (left, x - h), (right, x + h), (f(x + step), x + step))
        if h < _SEARCH_TOLERANCE and -1.0 < bend < 0.0:  # finer than the evidence resolves
            break
    precision = max(-curvature, 1e-9)
    return x, best + 0.5 * float(np.log(2.0 * np.pi / precision)), precision**-0.5


def _scales(trial: Trial, factors: Floats) -> str:
    """Return the option that divides torques by factors (n,)."""
    pairs = zip(trial.names, factors, strict=True)
    return " ".join(f"--scale tau:{name}={1.0 / factor:.4g}" for name, factor in pairs if factor != 1.0)


def _gained(trial: Trial, joints: tuple[int, ...], grid: Floats, prior: _Density, whose: str) -> PossibleCause:
    """Return the best gain of joints' torques, its logarithm searched, as a cause."""
    only = np.isin(range(trial.n), joints)

    def factors(u: float) -> Floats:
        return np.exp(u * only)

    u, value, std = _integrated(lambda u: trial.log(trial.scaled(factors(u))), grid, prior)
    says = f"{whose} {np.exp(u):.3g} (standard deviation {np.exp(u) * std:.2g}) times the arm's"
    return PossibleCause(trial.scaled(factors(u)), value, says, joints, _scales(trial, factors(u)), std)


_OTHER_LINK_PRICE = 3.0  # its log times the number of links is the price of a load that is not on the tip's link
_LOG_GAINS = np.array([-2.4, -1.2, -0.6, -0.2, 0.0, 0.2, 0.6, 1.2, 2.4])


def _load(trial: Trial) -> Iterator[PossibleCause]:
    model, links = trial.evidence.model, trial.evidence.belief.links
    for link in links:
        if link not in trial.supposed.loads:
            supposed = replace(trial.supposed, loads=(*trial.supposed.loads, link))
            elsewhere = 0.0 if link == model.frame().link else float(np.log(_OTHER_LINK_PRICE * len(links)))
            says = f"{model.link_names[link]} carries a body that the masses of the arm lack"
            yield trial.cause(supposed, says, price=elsewhere)


def _gain(trial: Trial) -> Iterator[PossibleCause]:
    prior = _either(_normal(0.15), _normal(1.2))
    for i, name in enumerate(trial.names):
        yield _gained(trial, (i,), _LOG_GAINS, prior, f"torques of {name} are")


_FLIPS = {  # fields with the other sign: report, and remedy
    ("gains",): ("torques of {0} have the other sign", "--sign tau:{0}"),
    ("signs",): ("positions of {0} count the other way", "--sign q_nominal:{0}{{rates:--sign qd:{0}}}"),
    ("signs", "gains"): (
        "{0} counts the other way, positions and torques",
        "--sign q_nominal:{0}{{rates:--sign qd:{0}}} --sign tau:{0}",
    ),
}


def _flipped(trial: Trial, *fields: str) -> Iterator[PossibleCause]:
    says, remedy = _FLIPS[fields]
    for i, name in enumerate(trial.names):
        if trial.moves[i] or "signs" not in fields:
            supposed = trial.supposed
            for field in fields:
                supposed = supposed.with_one(field, i, -getattr(supposed, field)[i])
            yield trial.cause(supposed, says.format(name), (i,), remedy.format(name))


_ZEROS = np.arange(-7, 9) * np.pi / 8
_SLIDING_ZEROS = np.linspace(-0.4, 0.4, 9)  # [m]


def _zero(trial: Trial) -> Iterator[PossibleCause]:
    for i, (name, unit) in enumerate(zip(trial.names, trial.evidence.model.joint_units, strict=True)):
        of, turns = trial.supposed.zeros[i], unit == "rad"

        def put(u: float, i: int = i, of: float = of) -> Supposed:
            return trial.supposed.with_one("zeros", i, of + u)

        wide: _Density = (lambda x: -float(np.log(2.0 * np.pi))) if turns else _normal(0.3)
        prior = _either(_normal(0.2 if turns else 0.05), wide)
        u, value, std = _integrated(lambda u: trial.log(put(u)), _ZEROS if turns else _SLIDING_ZEROS, prior)
        shown = f"{np.rad2deg(u):.1f} ({np.rad2deg(std):.1f}) deg" if turns else f"{1e3 * u:.0f} ({1e3 * std:.0f}) mm"
        says = f"positions of {name} are too large by {shown}, standard deviation in brackets"
        yield PossibleCause(
            put(u), value, says, (i,), f"--offset q_nominal:{name}={-u:.4g}", std / max(abs(u), 0.5 if turns else 0.1)
        )


_FRICTION_SHARE = 0.3  # prior standard deviation of a change of friction, as a share of a joint's torque
_CHANGE_SHARES = np.linspace(0.15, 0.85, 15)  # shares of the recording at which a change is tried
_MEAN = ": what is printed is a mean of before and after"
_DIFFERENCES = {  # from the arm as identified, by the shape of the torque that is added
    "zero": "the constant of {name} is {amount} from the one identified",
    "friction": "friction of {name} differs by {amount} in the mean from the one identified",
}
_CHANGES = {  # during a recording
    "zero": "the zero of the torque of {name} leaps by {amount} at about {after:.3g} s",
    "drift": "the zero of the torque of {name} drifts by {amount} along the recording",
    "load": "the load on {tip} changes at about {after:.3g} s",
}


def _added(trial: Trial, one: Added, says: str) -> PossibleCause:
    """Return an added torque as a cause, reported with joint, amount and time."""
    supposed, i = replace(trial.supposed, added=(*trial.supposed.added, one)), one.joint
    fit, name, amount = trial.evidence.fit(supposed, trial.which), "", ""
    if i >= 0:
        torque = trial.evidence.added(fit, one)[:, i]
        if one.shape == "friction":
            torque = torque * np.sign(trial.evidence.rows.motion(supposed)[1][:, i])
        mean = torque[-1] if one.shape == "drift" else torque[torque != 0.0].mean()
        name, amount = trial.names[i], f"{mean:+.2g} {TORQUE_UNIT[trial.evidence.model.joint_units[i]]}"
    says = says.format(name=name, amount=amount, after=one.after, tip=trial.evidence.model.tip)
    return PossibleCause(supposed, fit.log_evidence, says, (i,) if i >= 0 else ())


def _differs(trial: Trial, shape: str) -> Iterator[PossibleCause]:
    """Yield another zero of torque, or friction, of each joint than was identified."""
    speed = np.sqrt(np.mean(trial.evidence.rows.motion(trial.supposed)[1] ** 2, axis=0))
    for i, size in enumerate(trial.evidence.rows.size.tolist()):
        rubs = _FRICTION_SHARE * size
        one = Added(shape, i, (size,) if shape == "zero" else (rubs, rubs / max(float(speed[i]), 1e-9)))
        if one not in trial.supposed.added and (speed[i] > 0.0 or shape == "zero"):
            yield _added(trial, one, _DIFFERENCES[shape])


def _changes(trial: Trial, shape: str) -> Iterator[PossibleCause]:
    """Yield the best change along a recording, of a joint or the load on the tip, estimated from one fit without it."""
    evidence, belief, time = trial.evidence, trial.evidence.belief, trial.evidence.rows.samples.time
    sizes = {i: (size,) for i, size in enumerate(evidence.rows.size.tolist())}
    if shape == "load":
        carried = evidence.model.frame().link in belief.links
        sizes = {-1: tuple(np.diag(belief.load).tolist())} if carried else {}
    if evidence.rows.still or not sizes or any(one.shape == shape for one in trial.supposed.added):
        return
    times = [None] if shape == "drift" else [float(time[0] + share * np.ptp(time)) for share in _CHANGE_SHARES]
    tried = [Added(shape, i, size, after) for i, size in sizes.items() for after in times]
    cause = _added(trial, max(tried, key=evidence.looked(trial.supposed, trial.which)), _CHANGES[shape] + _MEAN)
    yield cause._replace(log_evidence=cause.log_evidence - float(np.log(len(tried))))


def _turn(trial: Trial) -> Iterator[PossibleCause]:
    time = trial.evidence.rows.samples.time

    def best(joints: Iterable[int], shares: Floats) -> tuple[float, int, float]:
        """Return the largest log evidence, the joint whose sign turns, and the share of the recording at which."""
        tried = ((i, share, (i, float(time[0] + share * np.ptp(time)))) for i in joints for share in shares)
        return max((trial.log(replace(trial.supposed, turned=(at,))), i, float(share)) for i, share, at in tried)

    if not trial.evidence.rows.still and not trial.supposed.turned:
        _, joint, share = best(range(trial.n), _CHANGE_SHARES[1::3])
        value, _, share = best([joint], share + _CHANGE_SHARES[5:10] - 0.5)
        after = float(time[0] + share * np.ptp(time))
        says = f"the sign of the torque of {trial.names[joint]} turns at about {after:.3g} s{_MEAN}"
        supposed = replace(trial.supposed, turned=((joint, after),))
        yield PossibleCause(supposed, value - float(np.log(trial.n * len(_CHANGE_SHARES))), says, (joint,))


def _all_signs(trial: Trial) -> Iterator[PossibleCause]:
    remedy = " ".join(f"--sign tau:{name}" for name in trial.names)
    flipped = trial.scaled(-np.ones(trial.n))
    yield trial.cause(flipped, "all torques have the other sign", tuple(range(trial.n)), remedy)


_UNITS = {"mNm": 1e3, "kgf m": 1.0 / STANDARD_GRAVITY, "Nm times 57.3": 57.29578, "Nm times 9.81": STANDARD_GRAVITY}
_UNIT_PRICE = 2.0  # nats
_COMMON_GAINS = np.linspace(-8.0, 8.0, 17)  # logarithms
_FROM_CURRENTS = (
    "--currents with a known --load, or --scale tau:JOINT=FACTOR of every joint, from the drives' data sheets"
)


def _in_unit(trial: Trial, unit: str, factors: Floats) -> PossibleCause:
    says, every = f"torques are in {unit}", tuple(range(trial.n))
    return trial.cause(trial.scaled(factors), says, every, _scales(trial, factors), _UNIT_PRICE)


def _common_gain(trial: Trial) -> Iterator[PossibleCause]:
    every, prior = tuple(range(trial.n)), _either(_normal(0.1), _normal(3.0))
    common = _gained(trial, every, _COMMON_GAINS, prior, "all torques are")
    yield common if common.error < UNSURE else common._replace(remedy=_FROM_CURRENTS, error=0.0)
    yield from (_in_unit(trial, unit, np.full(trial.n, g)) for unit, g in _UNITS.items())


_CURRENT_SWEEPS, _PERCENT = 3, 100.0


def _currents(trial: Trial) -> Iterator[PossibleCause]:
    one, only = np.ones(trial.n), np.eye(trial.n, dtype=bool)
    centre = _integrated(lambda u: trial.log(trial.scaled(np.exp(u * one))), _COMMON_GAINS, _normal(3.0))[0]
    logs, price = centre * one, -_normal(3.0)(centre)
    for sweep in range(_CURRENT_SWEEPS):
        for i in range(trial.n):

            def put(u: float, i: int = i) -> float:
                return trial.log(trial.scaled(np.exp(np.where(only[i], u, logs))))

            grid = logs[i] + np.array([-1.5, -0.5, 0.0, 0.5, 1.5]) / (1.0 + 2.0 * sweep)
            logs[i], _, std = _integrated(put, grid, _normal(1.0, centre))
            if sweep == _CURRENT_SWEEPS - 1:
                price -= float(np.log(std * np.sqrt(2.0 * np.pi))) + _normal(1.0, centre)(logs[i])
    factors = ", ".join(f"{name} {g:.3g}" for name, g in zip(trial.names, np.exp(-logs), strict=True))
    says = f"torques are motor currents, or in a unit for each joint; factors to Nm are about {factors}"
    yield trial.cause(trial.scaled(np.exp(logs)), says, tuple(range(trial.n)), _FROM_CURRENTS, price)
    limits = trial.evidence.model.effort_limit
    if (limits > 0.0).all() and np.isfinite(limits).all():
        yield _in_unit(trial, "percent of the joints' effort limits", _PERCENT / limits)


_GRAVITY_SHARES = np.linspace(-0.2, 1.8, 6)  # shares of gravity in the torques


def _no_gravity(trial: Trial) -> Iterator[PossibleCause]:
    supposed = replace(trial.supposed, gravity=(0.0, 0.0, 0.0))
    yield trial.cause(supposed, "gravity was taken out of the torques", remedy="--gravity 0,0,0")
    stated = trial.evidence.rows.samples.gravity
    if stated.ndim == 1 and stated.any() and trial.supposed.gravity is None:

        def put(share: float) -> Supposed:
            return replace(trial.supposed, gravity=tuple(share * stated))

        share, value, std = _integrated(lambda u: trial.log(put(u)), _GRAVITY_SHARES, _normal(0.4, 0.5))
        says = f"torques hold {share:.2g} (standard deviation {std:.1g}) of gravity"
        remedy = f"--gravity {','.join(f'{v:.4g}' for v in share * stated + 0.0)}"
        yield PossibleCause(put(share), value, says, (), remedy, std / max(abs(1.0 - share), 1e-9))


_WALLS = {
    "the base stands upright": (0, 0, -1), "the base hangs from a ceiling": (0, 0, 1),
    "the base is on a wall, its x axis down": (1, 0, 0), "the base is on a wall, its x axis up": (-1, 0, 0),
    "the base is on a wall, its y axis down": (0, 1, 0), "the base is on a wall, its y axis up": (0, -1, 0),
}  # fmt: skip
_TILT_RAD, _WALL_RAD = np.deg2rad(6.0), np.deg2rad(10.0)  # standard deviations
_WALL_PRICE, _TILT_STEPS = 3.0, 3
_NAMED_RAD = np.deg2rad(10.0)
_SURE_TILT_RAD = 0.3  # least tilt to which an error is related


def _tilt(trial: Trial) -> Iterator[PossibleCause]:
    samples = trial.evidence.rows.samples
    if samples.holds_gravity:
        return
    size = float(np.linalg.norm(samples.gravity))
    stated = np.array(samples.gravity if trial.supposed.gravity is None else trial.supposed.gravity)
    if not stated.any():
        return
    axes = {name: size * np.array(axis, dtype=float) for name, axis in _WALLS.items()}
    wall = max(axes.values(), key=lambda down: trial.log(replace(trial.supposed, gravity=tuple(down))))
    starts = [(stated, _TILT_RAD, 0.0)]
    if angle_between(wall, stated) > _NAMED_RAD:
        starts.append((wall, _WALL_RAD, _WALL_PRICE))
    for start, std, price in starts:
        supposed, value, error = _turned(trial, start, std)
        down = np.array(supposed.gravity)
        off = angle_between(down, stated)
        name = min(axes, key=lambda name: float(angle_between(down, axes[name])))
        named = angle_between(down, axes[name]) < _NAMED_RAD < off
        mounted = f": {name}" if named else ""
        down = axes[name] if named else down
        says = f"gravity is turned by {np.rad2deg(off):.1f} ({np.rad2deg(error):.1f}) deg from what was stated{mounted}"
        remedy = f"--gravity {','.join(f'{v:.4g}' for v in down + 0.0)}"
        yield PossibleCause(supposed, value - price, says, (), remedy, error / max(float(off), _SURE_TILT_RAD))


def _turned(trial: Trial, start: Floats, std: float) -> tuple[Supposed, float, float]:
    """Return the best gravity direction near a start, the evidence over both angles, and their error [rad]."""
    size, across = float(np.linalg.norm(start)), np.linalg.svd(start[None])[2][1:] * np.linalg.norm(start)
    supposed, turn = replace(trial.supposed, gravity=tuple(start)), np.zeros(2)
    for _ in range(_TILT_STEPS):
        beta = trial.evidence.fit(supposed, trial.which).beta
        own = trial.evidence.columns(supposed)[0]
        extra = []
        for way, had in zip(across, turn, strict=True):
            down = tuple(np.array(supposed.gravity) + way)
            change = (trial.evidence.columns(replace(supposed, gravity=down))[0] - own) @ beta
            extra.append(Extra(change, -float(had), std))
        fit = trial.evidence.fit(supposed, trial.which, extra)
        turn = turn + fit.beta[-2:]
        down = start + turn @ across
        supposed = replace(supposed, gravity=tuple(size * down / np.linalg.norm(down)))
    unsure = fit.covariance[-2:, -2:]
    value = trial.log(supposed) + 0.5 * float(np.linalg.slogdet(2.0 * np.pi * unsure)[1])
    value += _normal(std)(turn[0]) + _normal(std)(turn[1])
    return supposed, value, float(np.sqrt(np.diag(unsure).max()))


_EXCHANGED = {"torques alone": ("torque_order",), "all columns": ("torque_order", "position_order")}


def _swapped(trial: Trial) -> Iterator[PossibleCause]:
    units = trial.evidence.model.joint_units
    for (i, a), (j, b) in combinations(enumerate(trial.names), 2):
        for words, fields in _EXCHANGED.items():
            positions = "position_order" in fields
            if positions and units[i] != units[j]:
                continue
            supposed = trial.supposed.with_swapped(fields, i, j)
            moved = f"--swap q_nominal:{a},{b}{{rates:--swap qd:{a},{b}}} " if positions else ""
            says = f"{a} and {b} look swapped, {words}"
            yield trial.cause(supposed, says, (i, j), f"{moved}--swap tau:{a},{b}")


def _shared_drive(trial: Trial) -> Iterator[PossibleCause]:
    for i in range(trial.n - 1):
        for sign in (1.0, -1.0):
            if (i, i + 1, sign) not in trial.supposed.shared:
                supposed = replace(trial.supposed, shared=(*trial.supposed.shared, (i, i + 1, sign)))
                along = f"{trial.names[i]} {'+' if sign > 0.0 else '-'} {trial.names[i + 1]}"
                says = f"a drive moves {along}, with friction and a rotor of its own"
                yield trial.cause(supposed, says, (i, i + 1))


_DELAYS_S = np.array([-160, -80, -40, -20, -10, -5, 0, 5, 10, 20, 40, 80, 160]) / 1e3
_DELAYS_OF_JOINT_S = np.array([-40, -20, 20, 40]) / 1e3
_DELAY_STD_S = 0.03
_LEAST_DELAY_S = 0.012  # intervals of real arms' delays contain zero, and are about 10 ms wide at best


def _delay(trial: Trial) -> Iterator[PossibleCause]:
    step, late, every = trial.evidence.rows.step, trial.supposed.late, tuple(range(trial.n))

    def put(rows: int, joints: tuple[int, ...]) -> Supposed:
        return replace(trial.supposed, late=tuple(had + rows * (i in joints) for i, had in enumerate(late)))

    def tried(delays: Floats, joints: tuple[int, ...]) -> list[tuple[float, int, tuple[int, ...]]]:
        """Return the log evidence, the rows and the joints of delays [s], each of whole rows once."""
        whole = np.unique(np.rint(delays / step)).astype(int).tolist()
        return [(trial.log(put(rows, joints)) + _normal(_DELAY_STD_S)(rows * step), rows, joints) for rows in whole]

    of_joints = [one for i in every for one in tried(_DELAYS_OF_JOINT_S, (i,))]
    for (_, rows, whose), price in (
        (max(tried(_DELAYS_S, every)), 0.0),
        (max(of_joints), float(np.log(2.0 * trial.n))),
    ):
        fine = tried(step * (rows + np.linspace(-0.5, 0.5, 9) * max(abs(rows), 4)), whose)
        late_s = max(fine)[1] * step
        if abs(late_s) >= _LEAST_DELAY_S:
            text = "torques" if whose == every else f"torques of {trial.names[whose[0]]}"
            way = "late" if late_s > 0.0 else "early"
            says = f"{text} come {abs(late_s) * 1e3:.0f} ms too {way} for the motion: what is printed is off"
            spacing = step * (fine[-1][1] - fine[0][1]) / (len(fine) - 1)
            value = float(np.logaddexp.reduce([log for log, _, _ in fine]) + np.log(spacing)) - price
            yield PossibleCause(put(max(fine)[1], whose), value, says, () if whose == every else whose)


def _velocities(trial: Trial, mended: bool) -> Iterator[PossibleCause]:
    supposed = trial.supposed
    for fault in trial.evidence.rows.velocity_faults if supposed.derived is None else ():
        if bool(fault.remedy) == mended:
            derived, joints = replace(supposed, derived=fault.joints), fault.joints if mended else ()
            yield trial.cause(derived, fault.says, joints, fault.remedy, price=-fault.gain)
            if len(joints) == 1 and fault.remedy.startswith("--sign"):
                [i] = joints
                flipped = derived.with_one("signs", i, -derived.signs[i])
                says = f"positions of {trial.names[i]} count the other way, its velocities do not"
                yield trial.cause(flipped, says, joints, f"--sign q_nominal:{trial.names[i]}", price=-fault.gain)


def _of_joint(n: int) -> float:
    return float(np.log(3.0 * n))


_ALL = (
    Hypothesis("load", "arm", lambda n: 1.0, _load, by_masses=True),
    Hypothesis("gain", "torques", _of_joint, _gain, by_masses=True),
    Hypothesis("sign", "sign", lambda n: _of_joint(n) + 0.7, lambda t: _flipped(t, "gains")),
    Hypothesis("position sign", "sign", lambda n: _of_joint(n) + 2.0, lambda t: _flipped(t, "signs")),
    Hypothesis("backwards", "sign", _of_joint, lambda t: _flipped(t, "signs", "gains")),
    Hypothesis("zero", "offset", _of_joint, _zero),
    Hypothesis("torque zero", "offset", _of_joint, lambda t: _differs(t, "zero"), by_identification=True),
    Hypothesis("friction", "friction", _of_joint, lambda t: _differs(t, "friction"), by_identification=True),
    Hypothesis("zero leaps", "jump", lambda n: 1.0, lambda t: _changes(t, "zero")),
    Hypothesis("sign turns", "jump", lambda n: 1.0, _turn),
    Hypothesis("load changes", "jump", lambda n: 1.0, lambda t: _changes(t, "load")),
    Hypothesis("zero drifts", "drift", lambda n: 1.0, lambda t: _changes(t, "drift")),
    Hypothesis("all signs", "sign", lambda n: 2.5, _all_signs),
    Hypothesis("common gain", "torques", lambda n: 1.5, _common_gain, by_masses=True),
    Hypothesis("currents", "torques", lambda n: 2.5, _currents, by_masses=True),
    Hypothesis("no gravity", "gravity", lambda n: 3.0, _no_gravity, by_masses=True),
    Hypothesis("tilt", "gravity", lambda n: 1.5, _tilt, by_masses=True),
    Hypothesis("swapped", "swapped", lambda n: float(np.log(2.0 * n * (n - 1.0))) + 1.0, _swapped),
    Hypothesis("shared drive", "arm", lambda n: float(np.log(4.0 * n)), _shared_drive),
    Hypothesis("delay", "delay", lambda n: 1.5, _delay),
    Hypothesis("velocities", "velocities", lambda n: 0.0, lambda t: _velocities(t, True)),
    Hypothesis("late velocities", "velocities", lambda n: 0.0, lambda t: _velocities(t, False)),
)
HYPOTHESES = {hypothesis.name: hypothesis for hypothesis in _ALL}
