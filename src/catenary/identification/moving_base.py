"""A base that moved while nobody recorded it: what is left of the torques is as gravity that turned would leave it."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY

_WINDOW_S = 0.25  # in which gravity is taken for constant: a sixth of it is left at 1 Hz
_MIN_WINDOWS = 12
# of what turning gravity leaves to what turning at other times does: simulated bases 0.41 (11 deg) to 0.71 (0.6 deg);
# wrong friction, loads and zeros 0.93 and more, seven real recordings of five arms 0.97 and more
_TOLD_RATIO = 0.85
_ELSEWHERE = (0.31, 0.47, 0.61)  # of the windows: places from where a turning at other times is taken


def moving_base_notes(robot: RobotModel, phi: Floats, samples: Sequence[Samples], left: Sequence[Floats]) -> list[str]:
    """Return a note for each recording without gravity that an unrecorded motion of the base explains.

    In windows of a quarter second horizontal gravity is fitted to what is left, by the torques of the joints' places
    there and, as a rival that explains nothing, of places at other times.

    Args:
        phi: (10 L,) its links' parameters, as identified.
        left: (N, n) of each, measured less predicted torque [Nm or N].
    """
    notes = []
    for part, rest in zip(samples, left, strict=True):
        if part.holds_gravity or not part.qd.any():
            continue
        rows = max(1, int(_WINDOW_S / float(np.median(np.diff(part.time)))))
        count = len(part) // rows
        if count < _MIN_WINDOWS:
            continue
        unexplained, turned = _turned(robot, phi, part, rest, rows)
        if unexplained < _TOLD_RATIO:
            notes.append(
                f"{part.name}: residual torques are those of a moving base, by about "
                f"{np.rad2deg(turned):.1g} deg: record gravity and base_rate with the joints"
            )
    return notes


def _turned(robot: RobotModel, phi: Floats, part: Samples, rest: Floats, rows: int) -> tuple[float, float]:
    """Return the residual after turning gravity, relative to turning it at other times, and the turn [rad RMS]."""
    kept, still = slice(0, len(part) // rows * rows), np.zeros_like(part.q)
    down = part.gravity / np.linalg.norm(part.gravity)
    across = np.linalg.svd(down[None])[2][1:]  # two directions that a turn adds gravity along
    columns = [torque_regressor(robot, part.q, still, still, axis)[kept] @ phi for axis in across]
    size = np.maximum(np.sqrt(np.mean(rest**2, axis=0)), 1e-9)
    by_window = (len(part) // rows, rows * robot.n)
    G = np.stack([(column / size).reshape(by_window) for column in columns], axis=2)
    e = (rest[kept] / size).reshape(by_window)

    def fitted(shift: int) -> tuple[float, Floats]:
        moved = np.roll(G, shift, axis=0)
        gravity = np.linalg.pinv(moved) @ e[:, :, None]
        return float(np.sum((e - (moved @ gravity)[:, :, 0]) ** 2)), gravity[:, :, 0]

    own, gravity = fitted(0)
    elsewhere = np.mean([fitted(int(share * len(G)))[0] for share in _ELSEWHERE])
    return own / float(elsewhere), float(np.sqrt(np.mean(np.sum(gravity**2, axis=1)))) / STANDARD_GRAVITY
