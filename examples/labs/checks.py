"""Say whether a student's formulas are right or, of the usual mistakes, which one was made. For teachers to read."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

import catenary

DOWN = (0.0, 0.0, -9.81)
ARM = catenary.load_robot("two_link")
RNG = np.random.default_rng(0)
Q = RNG.uniform(-3.0, 3.0, (20, 2))
GRAVITY = RNG.normal(0.0, 6.0, (20, 3))
OPEN, RIGHT = "not filled in yet", "right"
ANOTHER = "not right, and none of the usual mistakes: "
CARRIED = (1.5, 0.25)  # kg m, of the rods of lab 1
NOISE = 0.05  # Nm
Answer = Sequence[float]
Usual = Mapping[str, np.ndarray]


def gravity(q: np.ndarray) -> np.ndarray:
    return catenary.gravity_torque(ARM, q, DOWN)


# ---- lab 1


def check_torque(torque: Callable[[np.ndarray], Answer]) -> str:
    """Check torques (2,) [Nm] that hold the arm at q (2,) [rad]."""
    if _open(torque(Q[0])):
        return OPEN
    apart = gravity(Q)
    apart[:, 0] -= 9.81 * np.cos(Q[:, 0])  # of the second rod at the first one's end
    usual = {
        RIGHT: gravity(Q),
        "the sign: gravity's own torque is this one, and motors hold against it": -gravity(Q),
        "g = 9.81 m/s2 is missing": gravity(Q) / 9.81,
        "the angles count from the horizontal: heights are sines, and their derivatives cosines": gravity(
            Q - [np.pi / 2, 0.0]
        ),
        "q[1] counts from the first rod: the second one's angle is q[0] + q[1]": gravity(
            np.column_stack([Q[:, 0], Q[:, 1] - Q[:, 0]])
        ),
        "masses sit half way along their rods, not at the ends": _at_the_ends(),
        "the first joint carries the whole second rod: it hangs on the first one's end": apart,
        "angles are in rad: np.cos takes no degrees": gravity(np.rad2deg(Q)),
    }
    return _verdict([torque(q) for q in Q], usual, Q)


def check_sag(sag: Callable[[np.ndarray, float], Answer]) -> str:
    """Check where a PD controller without gravity comes to rest, q - q_ref (2,) [rad]."""
    if _open(sag(Q[0], 1e4)):
        return OPEN
    usual = {
        RIGHT: -gravity(Q) / 1e4,
        "the sign: the arm sags in the direction in which gravity pulls it": gravity(Q) / 1e4,
        "at rest kp (q_ref - q) is the torque that holds the arm: divide by kp": -gravity(Q),
        "in rad, not degrees": np.rad2deg(-gravity(Q) / 1e4),
    }
    return _verdict([sag(q, 1e4) for q in Q], usual, Q)


def _at_the_ends() -> np.ndarray:
    ends = np.column_stack([np.cos(Q[:, 0]), 0.5 * np.cos(Q.sum(axis=1))])
    return 9.81 * np.column_stack([2.0 * ends[:, 0] + ends[:, 1], ends[:, 1]])


# ---- lab 2


def check_table(convention: str, a: Answer) -> str:
    """Check lengths a (2,) [m] of a Denavit-Hartenberg table."""
    tables = {"standard": np.array([1.0, 0.5]), "modified": np.array([0.0, 1.0])}
    if convention not in tables:
        return f'the convention: expected "standard" or "modified", got "{convention}"'
    if _open(a):
        return OPEN
    right = tables.pop(convention)
    ((other, its),) = tables.items()
    usual = {
        RIGHT: right,
        f'these are the lengths of the {other} convention, and the table says "{convention}"': its,
        "in m, not mm": 1000.0 * right,
        "from joint to joint, not to the centres of mass": right / 2.0,
        "the first row belongs to the first rod": right[::-1],
    }
    return _verdict([a], {said: np.array([its]) for said, its in usual.items()}, np.array(["the table"]), "row")


def check_regressor(regressor: Callable[[np.ndarray], Sequence[Answer]]) -> str:
    """Check a matrix (2, 2) [m/s2] of q (2,) [rad] that takes what joints carry [kg m] to torques [Nm]."""
    if _open(np.ravel(regressor(Q[0]))):
        return OPEN
    first, second = np.cos(Q[:, 0]), np.cos(Q.sum(axis=1))
    Z = 9.81 * np.array([[first, second], [0.0 * first, second]]).transpose(2, 0, 1)
    usual = {
        RIGHT: Z,
        "the sign: motors hold against gravity": -Z,
        "g = 9.81 m/s2 is missing": Z / 9.81,
        "rows are joints, columns are what they carry: this is the transpose": Z.transpose(0, 2, 1),
        "no mass belongs into the matrix: it is in s": Z * CARRIED,
        "the first joint carries the second rod, too: its row has no zero": Z * np.eye(2),
        "the second joint does not feel the first rod: one zero is missing": Z[:, [0, 0]],
        "q[1] counts from the first rod: the second one's angle is q[0] + q[1]": 9.81
        * np.array([[first, np.cos(Q[:, 1])], [0.0 * first, np.cos(Q[:, 1])]]).transpose(2, 0, 1),
        "the angles count from the horizontal: heights are sines, and their derivatives cosines": 9.81
        * np.array([[np.sin(Q[:, 0]), np.sin(Q.sum(axis=1))], [0.0 * first, np.sin(Q.sum(axis=1))]]).transpose(2, 0, 1),
    }
    return _verdict([np.ravel(regressor(q)) for q in Q], {k: v.reshape(-1, 4) for k, v in usual.items()}, Q, "entry")


def measured_torques(carried: Answer = (1.83, 0.41)) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (200, 2) [rad] and torques (200, 2) [Nm] that held an arm there, with noise."""
    rng = np.random.default_rng(2)
    q = rng.uniform(-3.0, 3.0, (200, 2))
    own = 9.81 * carried[1] * np.cos(q.sum(axis=1))
    exact = np.column_stack([9.81 * carried[0] * np.cos(q[:, 0]) + own, own])
    return q, exact + rng.normal(0.0, NOISE, q.shape)


def check_estimate(estimate: Callable[[np.ndarray, np.ndarray], Answer]) -> str:
    """Check an estimate (2,) [kg m] of what the joints carry, on arms of other masses than the one at hand."""
    if _open(estimate(*measured_torques())):
        return OPEN
    carried = np.array([[1.83, 0.41], [0.9, 0.6], [2.4, 0.2]])
    own = [estimate(*measured_torques(one)) for one in carried]
    few = [estimate(*(values[:1] for values in measured_torques(one))) for one in carried]
    usual = {
        RIGHT: carried,
        "in kg m, not Nm: g is in the matrix already": 9.81 * carried,
        "divided by g twice: it is in the matrix already": carried / 9.81,
        "the first column belongs to s[0]": carried[:, ::-1],
        "the sign: motors hold against gravity": -carried,
    }
    said = _verdict(own, usual, carried, "entry", tolerance=0.01)
    # what another number of poses does not change is of one pose, or of none
    if said.startswith(ANOTHER) and np.allclose(own, few, rtol=1e-6):
        return "of one pose, or of none: all poses are to decide"
    return said


def check_silent_pose(q: Answer) -> str:
    """Check a pose (2,) [rad] at which torques hold whatever the masses are."""
    if _open(q):
        return OPEN
    if not np.all(np.abs(q) <= 2.0 * np.pi):
        return "angles are in rad, from -pi to pi"
    torques = np.abs(np.cos([q[0], q[0] + q[1]]))
    for joint, moved in enumerate(("first", "second")):
        if torques[joint] > 1e-3:
            return f"not silent: at q = {np.round(q, 3)} the {moved} rod is not upright, and its mass turns a joint"
    return RIGHT


# ---- lab 3


def check_base_gravity(base_gravity: Callable[[float], Answer]) -> str:
    """Check gravity (3,) [m/s2] in the axes of a base turned about y by an angle [rad]."""
    if _open(base_gravity(0.3)):
        return OPEN
    pitches = Q[:, 0]
    found = _pitched(pitches)
    usual = {
        RIGHT: found,
        "turned the other way: a positive pitch lets x dip, and gravity then points along it": found * [-1, 1, 1],
        "this is what an accelerometer reads: gravity points down": -found,
        "turned about x: y stays horizontal here": found[:, [1, 0, 2]],
        "turned about x, the other way: y stays horizontal here": found[:, [1, 0, 2]] * [1, -1, 1],
        "on a level base it is (0, 0, -9.81): sine and cosine change places": found[:, [2, 1, 0]],
        "in m/s2: its length is 9.81": found / 9.81,
        "angles are in rad: np.sin takes no degrees": _pitched(np.rad2deg(pitches)),
    }
    return _verdict([base_gravity(pitch) for pitch in pitches], usual, pitches, "axis")


def _pitched(pitches: np.ndarray) -> np.ndarray:
    return np.array([catenary.FixedBase(pitch=pitch).sample(np.zeros(1)).gravity[0] for pitch in pitches])


def check_tilted_torque(torque: Callable[[np.ndarray, np.ndarray], Answer]) -> str:
    """Check torques (2,) [Nm] that hold the arm at q (2,) [rad] under any gravity (3,) [m/s2]."""
    if _open(torque(Q[0], GRAVITY[0])):
        return OPEN
    held = _held(GRAVITY)
    usual = {
        RIGHT: held,
        "the sign: motors hold against gravity": -held,
        "right on a level base only: gravity's x component turns the joints, too": _held(GRAVITY * [0, 0, 1]),
        "the sign of gravity's x component": _held(GRAVITY * [-1, 1, 1]),
        "the vector points down: on a level base its z component is -9.81": _held(GRAVITY * [1, 1, -1]),
        "gravity's own length counts, not 9.81": _held(9.81 * GRAVITY / np.linalg.norm(GRAVITY, axis=1, keepdims=True)),
        "x and z have changed places": _held(GRAVITY[:, [2, 1, 0]]),
    }
    return _verdict([torque(q, g) for q, g in zip(Q, GRAVITY, strict=True)], usual, Q)


def _held(vectors: np.ndarray) -> np.ndarray:
    return np.array([catenary.gravity_torque(ARM, q, vector) for q, vector in zip(Q, vectors, strict=True)])


def check_felt(felt: Callable[[np.ndarray], Answer]) -> str:
    """Check the gravity (3,) [m/s2] that torques need, from what an accelerometer reads (3,)."""
    if _open(felt(GRAVITY[0])):
        return OPEN
    length = np.linalg.norm(GRAVITY, axis=1, keepdims=True)
    usual = {
        RIGHT: -GRAVITY,
        "the sign: at rest the sensor reads upwards, and gravity points down": GRAVITY,
        "its length tells how the base accelerates, and the arm feels that, too: do not scale it": -9.81
        * GRAVITY
        / length,
        "gravity is in the reading already: nothing is to be added": -GRAVITY + DOWN,
        "gravity is in the reading already: nothing is to be subtracted": -GRAVITY - DOWN,
    }
    return _verdict([felt(reading) for reading in GRAVITY], usual, GRAVITY, "axis")


# ---- lab 4


@cache
def simulated_days() -> tuple[catenary.MotionLog, catenary.MotionLog]:
    """Return a zig-zag and a random motion of a simulated RAVEN-II with a second encoder at every joint."""
    rng = np.random.default_rng(0)
    arm = catenary.CablePlant(seed=0)
    arm.home()
    zigzag = catenary.record_simulated(arm, catenary.zigzag("J2-J3", [1 / 2]), "monday", rng)
    return zigzag, catenary.record_simulated(arm, catenary.random_sinusoids(rng, 60.0), "tuesday", rng)


def check_rms(rms: Callable[[np.ndarray], float]) -> str:
    """Check the root mean square of an error (N,)."""
    if _open([rms(np.ones(3))]):
        return OPEN
    errors = [np.random.default_rng(k).normal(0.3, 0.1 * (k + 1), 50) for k in range(5)]
    right = np.array([[np.sqrt(np.mean(e**2))] for e in errors])
    usual = {
        RIGHT: right,
        "the root is missing": right**2,
        "of squares: this is the mean of the absolute values": np.array([[np.abs(e).mean()] for e in errors]),
        "a mean error is an error, too: do not take it out": np.array([[e.std()] for e in errors]),
        "the mean of the squares, not their sum": right * np.sqrt(50.0),
        "this is the mean: errors up and down cancel": np.array([[e.mean()] for e in errors]),
        "in rad, not degrees": np.rad2deg(right),
    }
    return _verdict([[rms(e)] for e in errors], usual, np.arange(5), "value")


def check_line(line: Callable[[np.ndarray, np.ndarray], Answer]) -> str:
    """Check slope and offset (2,) of the best line from reported to true positions (N,) [rad]."""
    if _open(line(Q[:, 0], Q[:, 1])):
        return OPEN
    rng = np.random.default_rng(4)
    reported = rng.uniform(-1.0, 1.0, (5, 40))
    true = rng.uniform(0.9, 1.1, (5, 1)) * reported + rng.normal(0.1, 0.05, (5, 1)) + rng.normal(0.0, 0.02, (5, 40))
    pairs = [*zip(reported, true, strict=True)]
    right = np.array([np.polyfit(*pair, 1) for pair in pairs])
    usual = {
        RIGHT: right,
        "from reported to true: this is the line back": np.array([np.polyfit(b, a, 1) for a, b in pairs]),
        "slope first, then offset": right[:, ::-1],
        "of the true position, not of the error: add 1 to the slope": right - [1.0, 0.0],
        "the offset has the other sign": right * [1.0, -1.0],
        "a line has a slope, too: this is the offset alone": np.array([[1.0, (b - a).mean()] for a, b in pairs]),
        "a line has an offset, too: it need not pass through zero": np.array(
            [[a @ b / (a @ a), 0.0] for a, b in pairs]
        ),
    }
    return _verdict([line(*pair) for pair in pairs], usual, np.arange(5), "entry")


def check_test(trained_on: object, tested_on: object) -> str:
    """Check which rows a model is fitted to, and which its error is computed from."""
    if ... in (trained_on, tested_on):
        return OPEN
    names = ("monday", "tuesday", "monday, every other row")
    for name in (trained_on, tested_on):
        if name not in names:
            return f"expected one of {', '.join(names)}, got {name}"
    if trained_on == tested_on:
        return "a model knows the rows that it was fitted to: their error says nothing of tomorrow's"
    if "tuesday" not in (trained_on, tested_on):
        return "every other row is a neighbour of one that the model was fitted to, on the same motion and day"
    if trained_on == "tuesday":
        return "possible, but a zig-zag is no motion that the arm will be used for: train on it, test on the random one"
    return RIGHT


def check_direction(direction: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> str:
    """Check a column (N,) that says in which direction a position moves at given times."""
    time = np.arange(0.0, 10.0, 0.01)
    position = 0.3 * np.sin(time)
    column = direction(time, position)
    if column is ...:
        return OPEN
    column = np.asarray(column, dtype=float)
    if column.shape != time.shape:
        return f"one value a row: expected shape {time.shape}, got {column.shape}; np.gradient keeps the length"
    fast = np.abs(np.cos(time)) > 0.3
    if np.allclose(column, np.cos(time), atol=0.02) or np.allclose(column, 0.3 * np.cos(time), atol=0.02):
        return "this is the velocity: friction hardly depends on the speed, only on its sign"
    if np.allclose(column[fast], np.sign(position[fast]), atol=0.2):
        return "this is the sign of the position: of its change, please"
    if np.allclose(column[fast], -np.sign(np.cos(time))[fast], atol=0.2):
        return "the sign: +1 on the way up"
    if np.allclose(column[fast], np.sign(np.cos(time))[fast], atol=0.2):
        return RIGHT
    return f"{ANOTHER}expected about 1 on the way up, -1 on the way down; got {column.min():.3g} to {column.max():.3g}"


def _open(answer: Sequence[object]) -> bool:
    return any(one is ... for one in answer)


def _verdict(
    found: Sequence[Answer], usual: Usual, at: np.ndarray, what: str = "joint", tolerance: float = 1e-3
) -> str:
    """Return which of the usual answers (N, m) these are; else where, `at` (N, ...), they are farthest off."""
    own = np.array(found, dtype=float)
    right = usual[RIGHT]
    if own.shape != right.shape:
        return f"expected {right.shape[1]} numbers, got {own.shape[1:]}"
    for said, values in usual.items():
        if np.allclose(own, values, rtol=tolerance, atol=1e-6):
            return said
    wrong = int(np.argmax(np.abs(own - right).max(axis=1)))
    off = [k for k in range(right.shape[1]) if not np.allclose(own[:, k], right[:, k], rtol=tolerance)]
    if len(off) == right.shape[1]:
        which = {1: f"the {what}", 2: f"both {what}s"}.get(len(off), f"all {what}s")
    else:
        which = f"{what} {', '.join(map(str, off))} alone"
    place = at[wrong] if at.dtype.kind == "U" else f"q = {np.round(at[wrong], 3)}"
    return f"{ANOTHER}{which}; at {place} expected {right[wrong].round(5)}, got {own[wrong].round(5)}"
