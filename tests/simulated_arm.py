"""Recordings of an arm of three joints whose error is known: an offset, a ratio, and a little noise."""

from pathlib import Path
from typing import Any

import numpy as np

OFFSET = np.array([0.02, -0.03, 0.001])  # rad, rad, m
RATIO = 0.05
RATE = 30.0  # Hz


def arrays(*, rows: int = 400, seed: int = 0, noise: float = 1e-4, **changes: Any) -> dict[str, Any]:
    """Arrays of a command log; `changes` replaces or adds some, None leaves one out."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) / RATE
    pace, phase = rng.uniform(0.3, 0.9, 3), rng.uniform(0.0, 6.0, 3)
    q = np.array([0.5, 0.4, 0.05]) * np.sin(t[:, None] * pace + phase) + np.array([0.0, 0.0, 0.1])
    content = {
        "q_des": q,
        "q_act": q + OFFSET + RATIO * q + noise * rng.standard_normal(q.shape),
        "ok": np.ones(rows, dtype=bool),
        "t": t,
        "units": ["rad", "rad", "m"],
        **changes,
    }
    return {key: values for key, values in content.items() if values is not None}


def write(path: Path, **changes: Any) -> Path:
    """Write a command log; the keywords are those of `arrays`."""
    np.savez(path, allow_pickle=True, **arrays(**changes))
    return path


DH_TABLE = """
name = "arm"
convention = "modified"
sources = ["made up"]

[[link]]
name = "shoulder"
joint = "revolute"
alpha_deg = 0
a_m = 0.0
d_m = 0.0
theta_deg = 0
limits_deg = [-90, 90]
mass_kg = 1.0
com_m = [0.2, 0, 0]
inertia_kg_m2 = [0.01, 0, 0, 0.01, 0, 0.01]

[[link]]
name = "slide"
joint = "prismatic"
alpha_deg = 90
a_m = 0.3
d_m = 0.1
theta_deg = 0
limits_m = [0.0, 0.2]
massless = true
"""

URDF_WITHOUT_INERTIA = """
<robot name="bare">
  <link name="base"/><link name="upper"/><link name="fore"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="fore"/><origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""
