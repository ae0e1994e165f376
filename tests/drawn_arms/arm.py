"""A cable-driven arm drawn by seed, moved: what it reports, what a noisy encoder measures, and where it truly is."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from catenary.plant import MotionLog

LAWS = ("play", "Bouc-Wen", "Dahl", "Stribeck")


@njit(cache=True)
def _cables(u, load, dt, law, b, xs, fc, vs, ks, nl, alpha, T, drag):  # type: ignore[no-untyped-def]
    """Return errors of joints and friction (N, n) for cable coordinates u and loads (N, n), lengths in joint units."""
    N, n = u.shape
    err, fr = np.zeros((N, n)), np.zeros((N, n))
    z, p, c = np.zeros(n), u[0].copy(), np.zeros(n)
    for i in range(N):
        for j in range(n):
            dx = u[i, j] - u[i - 1, j] if i else 0.0
            s = 1.0 if dx > 0 else -1.0
            lag, level = 0.0, 1.0
            if law == 0:  # slack; Dahl of short travel for the torque alone
                p[j] = min(max(p[j], u[i, j] - b[j]), u[i, j] + b[j])
                lag = p[j] - u[i, j]
                z[j] = s + (z[j] - s) * np.exp(-abs(dx) / xs[j])
            elif law == 1:  # Bouc-Wen, exponent 2, in small steps
                k = int(np.ceil(abs(dx) / (0.2 * xs[j]))) + 1
                for _ in range(k):
                    d = dx / k / xs[j]
                    z[j] += d * (1.0 - (0.7 * (1.0 if d * z[j] > 0 else -1.0) + 0.3) * z[j] * z[j])
                lag = -b[j] * z[j]
            else:
                z[j] = s + (z[j] - s) * np.exp(-abs(dx) / xs[j])
                if law == 3:
                    level = 1.0 + 0.5 * np.exp(-((dx / dt / vs[j]) ** 2))
                lag = -b[j] * z[j] * level if law == 2 else 0.0
            fr[i, j] = fc[j] * z[j] * level
            f = load[i, j] + fr[i, j]
            st = np.sign(f) * nl[j] * np.log1p(abs(f) / nl[j]) * ks[j] if nl[j] > 0 else f * ks[j]
            c[j] += (alpha * st - c[j]) * dt / T
            err[i, j] = lag - st - c[j]
        for j in range(1, n):
            err[i, j] += drag[j] * z[j - 1]
    return err, fr


def _smoothed(q: np.ndarray, width: int) -> np.ndarray:
    kernel = np.ones(width) / width
    return np.apply_along_axis(lambda a: np.convolve(np.pad(a, width // 2, "edge"), kernel, "valid"), 0, q)


def _random(r: np.random.Generator, t: np.ndarray, n: int, pace: np.ndarray) -> np.ndarray:
    q = np.empty((len(t), n))
    for j in range(n):
        s = sum(
            r.uniform(0.5, 1) * np.sin(2 * np.pi * pace[j] * w * r.uniform(0.8, 1.25) * t + r.uniform(0, 6.3))
            for w in (0.31, 0.73, 1.0, 1.61)
        )
        q[:, j] = np.tanh(s / 1.2)
    return q


def _zigzag(r: np.random.Generator, t: np.ndarray, n: int, pace: np.ndarray) -> np.ndarray:
    phase = t[:, None] * pace * r.uniform(0.6, 1.4, n) + r.uniform(0, 1, n)
    q = (2 * np.abs(2 * (phase % 1) - 1) - 1) * r.uniform(0.75, 1, n)
    return _smoothed(q, max(1, int(0.15 / (t[1] - t[0]))) | 1)


def _task(r: np.random.Generator, t: np.ndarray, n: int, pace: np.ndarray) -> np.ndarray:
    """Reach, dwell, and dither about a workplace, by minimum jerk."""
    q, now, x = np.empty((len(t), n)), 0.0, r.uniform(-0.6, 0.6, n)
    home, far = r.uniform(-0.5, 0.5, n), r.uniform(-0.9, 0.9, (4, n))
    while now < t[-1] + 1e-9:
        y = far[r.integers(4)] if r.random() < 0.3 else home + r.normal(0, 0.12, n)
        y = np.clip(y, -1, 1)
        duration = max(0.4, (np.abs(y - x) / (4 * pace)).max()) * r.uniform(1, 1.6)
        m = (t >= now) & (t < now + duration)
        s = (t[m] - now) / duration
        q[m] = x + (y - x) * (s**3 * (10 - 15 * s + 6 * s * s))[:, None]
        now, x = now + duration, y
        if r.random() < 0.4:
            dwell = r.uniform(0.3, 1.5)
            q[(t >= now) & (t < now + dwell)] = x
            now += dwell
    return q


@dataclass(frozen=True)
class Moved:
    """A motion: the recording, and where the joints truly were (N, n) [rad|m]."""

    log: MotionLog
    true: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """True errors (N, n) [rad|m]."""
        return self.true - self.log.q_nominal


class Arm:
    """An arm drawn by seed: two to six joints, slack or friction of one of `LAWS`, stretch, creep, eccentric drums."""

    def __init__(self, seed: int, *, torque: bool | None = None, single: bool | None = None) -> None:
        r = np.random.default_rng(1000 + seed)
        self.seed, self.n, self.law = seed, int(r.integers(2, 7)), 0
        n = self.n
        self.law = int(r.integers(4))
        self.rate = float(r.choice([30, 60, 100, 200, 500], p=[0.2, 0.25, 0.25, 0.2, 0.1]))
        slides = (r.random(n) < 0.2) & (np.arange(n) > 0)
        self.units = tuple("m" if x else "rad" for x in slides)
        self.scale = np.where(slides, 1e3, 180 / np.pi)  # to deg and mm
        half = np.where(slides, r.uniform(30, 110, n) * 1e-3, np.radians(r.uniform(20, 130, n)))
        self.half, self.middle = half, np.where(slides, 0.12, np.radians(r.uniform(-30, 30, n)))
        self.pace = np.exp(r.uniform(np.log(0.05), np.log(0.25), n))
        rng = 2 * half
        self.b = rng * np.exp(r.uniform(np.log(0.0008), np.log(0.012), n))
        self.xs = self.b * r.uniform(0.3, 3, n)
        self.m, _, self.phase, self.payload = (
            r.uniform(0.5, 3, n),
            r.uniform(size=n),
            r.uniform(-2, 2, n),
            r.uniform(0.3, 1.0),
        )
        self.fc, self.vs = self.m * r.uniform(0.1, 0.8, n), rng * r.uniform(0.005, 0.05, n)
        self.ks = rng * np.exp(r.uniform(np.log(0.0005), np.log(0.008), n)) / (self.m * 2)
        self.nl = np.where(r.random(n) < 0.5, self.m * r.uniform(0.3, 2, n), 0.0)
        self.couple = np.where(r.random(n) < 0.4, r.uniform(-0.8, 0.8, n), 0.0)
        self.couple[0] = 0
        self.drag = np.where(r.random(n) < 0.3, r.uniform(0.001, 0.006, n) * rng, 0.0)
        self.drums = [
            (
                rng[j] * np.exp(r.uniform(np.log(0.0004), np.log(0.005))),
                r.choice([1.0, 2.0, 3.0, 5.0]),
                r.uniform(0, 6.3),
            )
            for j in range(n)
        ]
        self.alpha, self.T = r.uniform(0, 0.4), r.uniform(20, 120)
        has_torque = bool(r.random() < 0.75)
        self.torque_noise, self.torque_unit = r.uniform(0.05, 0.8), r.uniform(0.5, 2, n)
        self.noise = rng * np.exp(r.uniform(np.log(5e-5), np.log(6e-4), n))
        self.outliers, self.zero = r.choice([0, 0.002, 0.005]), rng * r.normal(0, 0.004, n)
        has_one = bool(r.random() < 0.5)
        self.torque = has_torque if torque is None else torque
        self.single = has_one if single is None else single
        d = np.random.default_rng(5000 + seed)
        other: dict[str, Any] = {"b": d.uniform(0.7, 1.3), "f": d.uniform(0.8, 1.3), "k": d.uniform(0.8, 1.25)}
        other["z"] = rng * d.normal(0, 0.004, n)
        self.days: list[dict[str, Any]] = [{"b": 1.0, "f": 1.0, "k": 1.0, "z": np.zeros(n)}, other]

    def __str__(self) -> str:
        torque, logs = "torque" if self.torque else "no torque", "1 log" if self.single else "3 logs"
        return f"arm {self.seed}: {self.n} joints, {LAWS[self.law]}, {self.rate:.0f} Hz, {torque}, {logs}, outliers {self.outliers}"

    def _load(self, q: np.ndarray, dt: float, payload: bool) -> np.ndarray:
        slides = np.array(self.units) == "m"
        a = np.cumsum(np.where(slides, 0.3, 1.0) * np.where(slides, q / self.half, q), axis=1) + self.phase
        w = self.m.copy()
        w[-1] *= 1.0 + payload * self.payload
        g = np.sin(a) * w
        load = np.cumsum(g[:, ::-1], axis=1)[:, ::-1] / np.sqrt(np.arange(self.n, 0, -1))
        v = np.gradient(q, dt, axis=0)
        return load + self.m / self.half * (0.02 * np.gradient(v, dt, axis=0) + 0.03 * v)

    def moved(self, motion: str, seed: int, seconds: float, *, day: int = 0, payload: bool = False) -> Moved:
        """Return a recording of random, zigzag or task motion."""
        r = np.random.default_rng([self.seed, seed])
        inner = max(1, round(120 / self.rate))
        dt = 1 / self.rate / inner
        t = np.arange(0, seconds, dt)
        q = {"random": _random, "zigzag": _zigzag, "task": _task}[motion](r, t, self.n, self.pace)
        q = _smoothed(q, max(3, int(0.1 / dt)) | 1) * self.half + self.middle
        today = self.days[day]
        u = q + self.couple * np.roll(q / self.half, 1, axis=1) * self.half
        law = (self.law, self.b * today["b"], self.xs, self.fc * today["f"], self.vs, self.ks / today["k"], self.nl)
        e, friction = _cables(u, load := self._load(q, dt, payload), dt, *law, self.alpha, self.T, self.drag)
        drums = zip(self.drums, q.T, self.units, self.half, strict=True)
        wobble = [a * np.sin(k * x / (1 if unit == "rad" else half) + p) for (a, k, p), x, unit, half in drums]
        true = (q + e + np.column_stack(wobble) + self.zero + today["z"])[::inner]
        t, q, tau = t[::inner], q[::inner], (load + friction)[::inner] * self.torque_unit
        tau = tau + r.normal(0, self.torque_noise, q.shape) * self.fc * self.torque_unit
        encoder = true + r.normal(0, 1, q.shape) * self.noise
        bad = r.random(len(t)) < self.outliers
        encoder[bad] += r.normal(0, 0.1, (bad.sum(), self.n)) * self.half
        names = tuple(f"J{j + 1}" for j in range(self.n))
        ok = np.ones(len(t), dtype=bool)
        log = MotionLog(f"{motion} {seed}", names, self.units, q, ok, encoder, t, tau=tau if self.torque else None)
        return Moved(log, true)

    def training(self, minutes: float | None = None) -> list[Moved]:
        """Return one recording of random motion, or three of a motion each."""
        s = min(240, 14000 / self.rate) if self.rate < 200 else 90
        s = s if minutes is None else 60.0 * minutes
        if self.single:
            return [self.moved("random", 1, s)]
        return [self.moved(motion, 1 + k, s / 3) for k, motion in enumerate(("zigzag", "random", "task"))]

    def tests(self) -> dict[str, Moved]:
        """Return other motions by name, one with another payload and one of another day."""
        s = min(90, 9000 / self.rate)
        found = {name: self.moved(name, seed, s) for name, seed in (("random", 11), ("task", 12), ("zigzag", 13))}
        return found | {"payload": self.moved("random", 14, s, payload=True), "day": self.moved("random", 15, s, day=1)}
