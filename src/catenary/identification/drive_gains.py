"""Drive gains [Nm/A or N/A] from motor currents of an arm alone and with a load of known mass.

Currents alone show every mass times one unknown factor, and another one for each axis that shares no mass with others.
A known mass on the last link makes torques of known size: K_j i_j = Y_j beta + [loaded] (m y_j + L_j lambda), with the
load's moment and inertia lambda unknown, and friction of its own for either recording [Gautier, Briot, "Global
identification of joint drive gains and dynamic parameters of robots", J. Dynamic Systems, Measurement, and Control
136(5), 2014]. Noise is in the currents: i_j - (Y_j beta + ...) / K_j is minimised, each axis weighted by its residual.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK
from catenary.errors import ExcitationError, InputError
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.least_squares import scaled_solution
from catenary.identification.samples import Samples
from catenary.robots.friction_terms import FRICTION_TERMS
from catenary.robots.model import RobotModel

_MAX_ROUNDS = 50
_CONVERGED_LOG_STEP = 1e-7  # of the logarithm of a gain
_VISIBLE_RATIO = 1e-9  # smallest singular value, columns scaled to one
_MAX_LOG_STEP = 0.5  # step of that logarithm
_LOADED_KINDS = tuple(kind for kind, term in FRICTION_TERMS.items() if term.usual)  # friction that a load changes
_BLOCK_COUNT = 20  # of every recording, each left out in turn: of five, a standard error is itself a third off
_SURE_ERROR = 0.2  # relative standard error of a gain: beyond it the recordings do not show it


@dataclass(frozen=True)
class DriveGains:
    """Gains with their standard errors, and the load as it was found."""

    gains: Floats  # (n,) [Nm/A or N/A]
    errors: Floats  # (n,) relative, standard; those that all have in common and of the load's centre are in them
    load: float  # [kg] as stated
    centre: Floats  # (3,) [m] in the tip's frame

    def notes(self, model: RobotModel) -> list[str]:
        """Return the gains in words, and by how much they leave masses open."""
        gains = ", ".join(
            f"{name} {gain:.4g} ({100.0 * error:.1f} %)"
            for name, gain, error in zip(model.joint_names, self.gains, self.errors, strict=True)
        )
        x, y, z = self.centre
        return [
            f"drive gains [Nm/A, N/A], standard error: {gains}; masses are open by as much as the gains of axes "
            "that carry them",
            f"load of {self.load:g} kg: its centre was found at ({x:.3f}, {y:.3f}, {z:.3f}) m in {model.tip}",
        ]


def drive_gains(base: BaseParameters, free: Sequence[Samples], loaded: Sequence[Samples], load: float) -> DriveGains:
    """Find the gains of all drives from torques that are currents [A], of the arm alone and with a load [kg] on it.

    `base` is of the robot with its rotors.
    """
    model = base.parameters.model
    if not free or not loaded:
        raise InputError("currents: expected a recording of the arm alone, and one with a known load (--load KG LOG)")
    if not 0.0 < load < np.inf:
        raise InputError(f"load: expected a mass above 0 kg, got {load:g}")
    link, pose = model.frame()
    parts = [(part, with_load) for with_load, group in ((False, free), (True, loaded)) for part in group]
    folds = [_triangles(base, parts, link, block) for block in range(_BLOCK_COUNT)]
    # its column, behind those of friction
    mass = base.count + sum(name.split()[0] in _LOADED_KINDS for name in base.names)
    gains, unknown = _solved(folds, mass, load)
    left_out = np.log([_solved([*folds[:f], *folds[f + 1 :]], mass, load, gains)[0] for f in range(_BLOCK_COUNT)])
    errors = np.sqrt((_BLOCK_COUNT - 1) / _BLOCK_COUNT * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0))
    unsure = [f"{model.joint_names[i]} ({100.0 * errors[i]:.0f} %)" for i in np.flatnonzero(~(errors < _SURE_ERROR))]
    if unsure:
        raise ExcitationError(
            f'robot "{model.name}": the recordings do not show the drive gain of {", ".join(unsure)}: masses '
            "are uncertain by as much; move every joint, with and without the load, over more of its range and faster, "
            "or use a heavier load",
            rank=model.n - len(unsure),
            n_base=model.n,
        )
    centre = pose.rotation.T @ (unknown[mass + 1 : mass + 4] / load - pose.position)
    return DriveGains(gains, errors, load, centre)


def _triangles(base: BaseParameters, parts: Sequence[tuple[Samples, bool]], link: int, block: int) -> list[Floats]:
    """Return R of [parameters | friction with load | load | current] of each axis, on one block of time."""
    model = base.parameters.model
    own = [k for k, name in enumerate(base.names) if name.split()[0] in _LOADED_KINDS]
    stacks: list[list[Floats]] = [[] for _ in range(model.n)]
    for whole, with_load in parts:
        part = whole.rows(np.arange(len(whole)) * _BLOCK_COUNT // len(whole) == block, whole.name)
        for rows, Y in base.chunks(part):
            load = part.link_columns(model, rows)[:, :, PER_LINK * link : PER_LINK * (link + 1)] * with_load
            A = np.concatenate([Y, Y[:, :, own] * with_load, load, part.tau[rows, :, None]], axis=2)
            for i in range(model.n):
                stacks[i].append(A[:, i])
    return [np.asarray(np.linalg.qr(np.concatenate(stack), mode="r")) for stack in stacks]


def _solved(
    folds: Sequence[Sequence[Floats]], mass: int, load: float, start: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return gains (n,) and parameters (k,) by Gauss-Newton steps, from those of linear least squares."""
    axes = [np.asarray(np.linalg.qr(np.concatenate(parts), mode="r")) for parts in zip(*folds, strict=True)]
    n, k = len(axes), axes[0].shape[1] - 1
    free = np.array([c for c in range(k) if c != mass])
    bounds = np.cumsum([0, *(len(R) for R in axes)])
    unknown = np.zeros(k)
    unknown[mass] = load
    A, right = np.zeros((bounds[-1], n + k - 1)), np.zeros(bounds[-1])
    for i, R in enumerate(axes):  # K i - Y x = m y
        rows, weight = slice(bounds[i], bounds[i + 1]), 1.0 / max(float(np.linalg.norm(R[:, k])), 1e-300)
        A[rows, i], A[rows, n:], right[rows] = weight * R[:, k], -weight * R[:, free], weight * load * R[:, mass]
    solution = scaled_solution(A, right, _VISIBLE_RATIO)
    unknown[free] = solution[n:]
    gains = solution[:n] if start is None else start
    logs = np.log(np.where(gains > 0.0, gains, np.abs(gains).max()))
    for _ in range(_MAX_ROUNDS):
        for i, R in enumerate(axes):
            rows, gain = slice(bounds[i], bounds[i + 1]), np.exp(logs[i])
            explained = R[:, :k] @ unknown / gain
            left = R[:, k] - explained
            weight = 1.0 / max(float(np.linalg.norm(left)), 1e-300)
            A[rows] = 0.0
            A[rows, i], A[rows, n:], right[rows] = -weight * explained, weight * R[:, free] / gain, weight * left
        step = scaled_solution(A, right, _VISIBLE_RATIO)
        largest = float(np.abs(step[:n]).max())
        step *= min(1.0, _MAX_LOG_STEP / max(largest, 1e-300))
        logs, unknown[free] = logs + step[:n], unknown[free] + step[n:]
        if largest < _CONVERGED_LOG_STEP:
            break
    return np.exp(logs), unknown
