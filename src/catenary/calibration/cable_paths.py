"""Finds what a joint's cable follows, and its slack: where it runs over another joint's drum, both move it.

A joint's error may depend on play of its position and a factor times another's. The factor is searched for, and then
the half-width of its slack, so that a ridge regression on play states and all else predicts blocks of time that it was
not fitted to. What is found is taken where it explains more than the joint's own position and a ladder of widths do.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize_scalar
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions, FoundCables
from catenary.calibration.friction_search import MIN_ROWS, SearchedRows, SumsBeside, is_gain, searched_rows
from catenary.calibration.recordings import Recordings
from catenary.verdict.command_response import play

_FACTORS = (-1.2, -0.8, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 0.8, 1.2)  # of ranges, from which the search begins
_SLACKS = tuple(0.0004 * 1.25**k for k in range(22))  # of a path's range
_MIN_PATH_LOG_GAIN = 0.28  # in the logarithm of the error: zig-zags show up to 0.25 where there is no such path
_MAX_SLACKS = 2  # of a joint
_POWERS = (2, 3)


def find_cables(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> FoundCables:
    """Return the paths of cables and their slack, looking only at what comes before the held-out part."""
    with threadpool_limits(limits=1):
        rows = searched_rows(recordings, options, held_out)
        if len(rows.fixed) < MIN_ROWS:
            return FoundCables()
        moving = {name for name, _ in rows.signals.play}
        joints = [j for j, name in enumerate(rows.joint_names) if f"q:{name}" in moving]
        per_joint = [_Search(rows, j, joints).found() for j in joints]
    return FoundCables(
        sum((cables.paths for cables in per_joint), ()), sum((cables.slacks for cables in per_joint), ())
    )


class _Search:
    def __init__(self, rows: SearchedRows, joint: int, joints: Sequence[int]) -> None:
        self._rows, self._joint = rows, joint
        self._others = [other for other in joints if other != joint]
        own = rows.fixed[:, rows.signals.names.index(f"q:{rows.joint_names[joint]}")]
        z = (own - own.mean()) / own.std()
        smooth = np.column_stack([rows.fixed[:, rows.columns([joint])], *(z**power for power in _POWERS)])
        self._sums = SumsBeside(smooth, rows.error[:, [joint]], rows.block)
        self._before = self._errors(0, 0.0, PLAY_SHARES)

    def found(self) -> FoundCables:
        name = self._rows.joint_names[self._joint]
        unit, position = self._rows.ranges[self._joint], f"q:{name}"
        other, factor = self._path()
        paths: tuple[tuple[str, str, str, float], ...] = ()
        if factor:
            ratio = float(f"{factor * unit / self._rows.ranges[other]:.6g}")
            drum = f"q:{self._rows.joint_names[other]}"
            paths = ((f"{position}{ratio:+.6g}*{drum}", position, drum, ratio),)
        where = paths[0][0] if paths else position
        slacks = self._slacks(other, factor)
        return FoundCables(paths, tuple((where, float(f"{slack * unit:.6g}")) for slack in slacks))

    def _path(self) -> tuple[int, float]:
        """Return another joint and its factor, of ranges; 0 where the joint's own position will do."""
        tried = [(self._score(other, f, PLAY_SHARES), other, f) for other in self._others for f in _FACTORS]
        if not tried:
            return 0, 0.0
        _, other, start = min(tried)
        factor = _least(lambda f: self._score(other, f, PLAY_SHARES), start, 0.3)
        errors = self._errors(other, factor, PLAY_SHARES)
        if not is_gain(self._before, errors, _MIN_PATH_LOG_GAIN):
            return 0, 0.0
        self._before = errors
        return other, factor

    def _slacks(self, other: int, factor: float) -> list[float]:
        """Return half-widths, of the range, that explain more than a ladder of them."""
        half_widths: list[float] = []
        while len(half_widths) < _MAX_SLACKS:
            shares = (*PLAY_SHARES, *half_widths)
            start = min(_SLACKS, key=lambda share: self._score(other, factor, (*shares, share)))

            def score(log_share: float, shares: tuple[float, ...] = shares) -> float:
                return self._score(other, factor, (*shares, float(np.exp(log_share))))

            share = float(np.exp(_least(score, float(np.log(start)), 0.22)))
            errors = self._errors(other, factor, (*shares, share))
            if not is_gain(self._before, errors):
                break
            half_widths.append(share)
            self._before = errors
        return half_widths

    def _score(self, other: int, factor: float, shares: Sequence[float]) -> float:
        return float(np.log(self._errors(other, factor, shares)).mean())

    def _errors(self, other: int, factor: float, shares: Sequence[float]) -> Floats:
        """Return the joint's RMSE on blocks (K, 1) with play states along a path."""
        widths = np.array(shares)

        def states(path: Floats) -> Floats:
            return play_states(path[:, self._joint] + factor * path[:, other], widths)

        return self._sums.errors(self._rows.of_paths(states))


def _least(score: Callable[[float], float], start: float, away: float) -> float:
    minimum = minimize_scalar(score, bounds=(start - away, start + away), method="bounded", options={"xatol": 1e-4})
    return float(minimum.x) if minimum.fun < score(start) else start


def play_states(path: Floats, widths: Floats) -> Floats:
    """Return play states of half-widths (K,) along a path (N,), each from the middle of its slack, less the path."""
    return np.column_stack([play(path, width) for width in widths]) - path[:, None]
