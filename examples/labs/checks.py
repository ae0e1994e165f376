"""Say whether a student's formulas are right or, of the usual mistakes, which one was made. For teachers to read."""

from collections.abc import Callable

import numpy as np

import catenary

DOWN = (0.0, 0.0, -9.81)
ARM = catenary.load_robot("two_link")
Q = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 2))
OPEN, RIGHT = "not filled in yet", "right"
ANOTHER = "not right, and none of the usual mistakes: "


def gravity(q: np.ndarray) -> np.ndarray:
    return catenary.gravity_torque(ARM, q, DOWN)


def check_torque(torque: Callable[[np.ndarray], list[float]]) -> str:
    """Check torques (2,) [Nm] that hold the arm at q (2,) [rad]."""
    if ... in torque(Q[0]):
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
    return _told([torque(q) for q in Q], usual, Q)


def check_sag(sag: Callable[[np.ndarray, float], list[float]]) -> str:
    """Check where a PD controller without gravity comes to rest, q - q_ref (2,) [rad]."""
    if ... in sag(Q[0], 1e4):
        return OPEN
    usual = {
        RIGHT: -gravity(Q) / 1e4,
        "the sign: the arm sags in the direction in which gravity pulls it": gravity(Q) / 1e4,
        "at rest kp (q_ref - q) is the torque that holds the arm: divide by kp": -gravity(Q),
        "in rad, not degrees": np.rad2deg(-gravity(Q) / 1e4),
    }
    return _told([sag(q, 1e4) for q in Q], usual, Q)


def _at_the_ends() -> np.ndarray:
    ends = np.column_stack([np.cos(Q[:, 0]), 0.5 * np.cos(Q.sum(axis=1))])
    return 9.81 * np.column_stack([2.0 * ends[:, 0] + ends[:, 1], ends[:, 1]])


def _told(found: list, usual: dict[str, np.ndarray], q: np.ndarray) -> str:
    own = np.array(found, dtype=float)
    for said, values in usual.items():
        if np.allclose(own, values, rtol=1e-3, atol=1e-6):
            return said
    right = usual[RIGHT]
    wrong = int(np.argmax(np.abs(own - right).max(axis=1)))
    joints = [k for k in range(2) if not np.allclose(own[:, k], right[:, k], rtol=1e-3)]
    which = "both joints" if len(joints) == 2 else f"joint {joints[0]} alone"
    return f"{ANOTHER}{which}; at q = {q[wrong].round(3)} expected {right[wrong].round(5)}, got {own[wrong].round(5)}"
