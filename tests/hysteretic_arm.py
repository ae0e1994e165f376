"""A sound recording of an arm with a stiff base and a hysteretic wrist."""

import numpy as np

from catenary.plant import MotionLog


def play(command: np.ndarray, half_width: float) -> np.ndarray:
    """Return where a joint with slack is: it moves when its command leaves half the slack behind."""
    at, path = command[0], []
    for q in command:
        at = min(max(at, q - half_width), q + half_width)
        path.append(at)
    return np.array(path)


def recording(seed: int = 0, rows: int = 1500) -> MotionLog:
    """An arm with a stiff base and an hysteretic wrist, visiting random poses."""
    rng = np.random.default_rng(seed)
    centre = np.array([0.5, 1.4, 0.37, 0.0, 0.0])
    reach = np.array([0.25, 0.2, 0.04, 1.0, 0.8])
    via = rng.uniform(-1.0, 1.0, (rows // 5 + 2, 5)) * reach + centre
    q = np.column_stack([np.interp(np.arange(rows), 5 * np.arange(len(via)), column) for column in via.T])
    slack = np.array([0.003, 0.003, 0.0005, 0.02, 0.2])
    moved = np.column_stack([play(q[:, j], slack[j]) for j in range(5)])
    moved += np.array([0.01, -0.02, 0.001, 0.15, -0.1]) + 1e-3 * reach * rng.standard_normal(q.shape)
    return MotionLog(
        name="poses",
        joint_names=("J1", "J2", "J3", "J4", "J5"),
        joint_units=("rad", "rad", "m", "rad", "rad"),
        q_nominal=q,
        q_encoder=moved,
        ok=rng.random(rows) > 0.02,
        time=0.4 * np.arange(float(rows)),
    )
