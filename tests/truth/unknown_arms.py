"""Faults put into recordings of arms drawn by seed: each is named with its size, refused, or what a fit claims holds."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary.plant import MotionLog
from catenary.verdict.check import findings_of
from catenary.verdict.finding import Finding
from tests import spoilt
from tests.drawn_arms.arm import Arm, Moved
from tests.truth.bench import CLOSE, FAILS, FEW, HOLDS, LEAST, Outcome, near, reported, run, true_errors, written
from tests.truth.spoilings import coarse, dropped, filled, late, wild

SEEDS, SECONDS = range(20), 60.0
MOTIONS = ("random", "zigzag", "task")
# untouched recordings of each arm: motion, seed, seconds, day
UNTOUCHED = (("random", 21, 60.0, 0), ("zigzag", 22, 60.0, 0), ("task", 23, 60.0, 0), ("random", 24, 30.0, 0),
             ("task", 25, 120.0, 1))  # fmt: skip
WRAPS_AT = 0.4  # of the command's range


class Fault(NamedTuple):
    """A fault of a recording, and the findings that name it."""

    name: str
    spoil: Callable[[MotionLog], MotionLog]
    named_by: tuple[str, ...]
    size: str = ""  # what finds the size in a finding's words
    true: tuple[float, float] = (0.0, 0.0)  # between which it lies
    delay: float | None = None  # that intervals must hold [s]
    alone: bool = False  # of the second joint alone


def _sized(log: MotionLog, deg_or_mm: float) -> float:
    return deg_or_mm * (np.pi / 180.0 if log.joint_units[1] == "rad" else 1e-3)


def _slipped(log: MotionLog, where: float) -> MotionLog:
    assert log.q_encoder is not None
    measured = log.q_encoder.copy()
    measured[int(where * len(log)) :, 1] += _sized(log, 3.0)
    return replace(log, q_encoder=measured)


def _coupled(log: MotionLog, entry: float) -> MotionLog:
    assert log.q_encoder is not None
    measured = log.q_encoder.copy()
    measured[:, 1] += entry * _sized(log, 1.0) / np.radians(1.0) * measured[:, 0]  # the first joint turns
    return replace(log, q_encoder=measured)


def _wrapped(log: MotionLog) -> MotionLog:
    return spoilt.wrapped(log, 1, WRAPS_AT * float(np.ptp(log.q_nominal[:, 1])))


def _sentinels(log: MotionLog) -> MotionLog:
    assert log.q_encoder is not None
    measured = log.q_encoder.copy()
    measured[::50] = -1.0
    return replace(log, q_encoder=measured)


def _restarted(log: MotionLog) -> MotionLog:
    """Return a log whose sensor's computer restarts half-way: its clock is .25 s behind from there on."""
    half, after = len(log) // 2, late(log, 0.25)
    assert log.q_encoder is not None
    assert after.q_encoder is not None
    rows = np.arange(len(log))[:, None] >= half
    return replace(log, q_encoder=np.where(rows, after.q_encoder, log.q_encoder), ok=log.ok & after.ok)


FAULTS = (
    Fault("0.1 s late", lambda g: late(g, 0.1), ("delay",), delay=0.1),
    Fault("0.3 s late", lambda g: late(g, 0.3), ("delay",), delay=0.3),
    Fault("0.08 s early", lambda g: late(g, -0.08), ("delay",), delay=-0.08),
    Fault("one joint 0.3 s late", lambda g: late(g, 0.3, slice(1, 2)), ("clock",), delay=0.3, alone=True),
    Fault("one joint 0.1 s late", lambda g: late(g, 0.1, slice(1, 2)), ("clock",), delay=0.1, alone=True),
    Fault("a clock 0.5 % fast", lambda g: spoilt.drifting(g, 0.005), ("clock",), r"([\d.]+) ppm", (4700.0, 5300.0)),
    Fault("restart, then .25 s late", _restarted, ("clock", "delay")),
    Fault("a coupling of 0.3", lambda g: _coupled(g, 0.3), ("mixed",), r"J2/J1 ([\d.]+)", (0.25, 0.35)),
    Fault("scale 1.3", lambda g: spoilt.scaled(g, "q_encoder", [1], 1.3), ("scale",), r"J2=([\d.]+)", (0.73, 0.81)),
    Fault("scale 0.5", lambda g: spoilt.scaled(g, "q_encoder", [1], 0.5), ("scale",), r"J2=([\d.]+)", (1.8, 2.2)),
    Fault("scale 1.05", lambda g: spoilt.scaled(g, "q_encoder", [1], 1.05), ("scale",)),
    Fault("a sign", lambda g: spoilt.scaled(g, "q_encoder", [1], -1.0), ("sign",)),
    Fault("a counter that wraps", _wrapped, ("turns",)),
    *(
        Fault(f"3 deg or mm of slip at {where:.0%}", lambda g, where=where: _slipped(g, where), ("jump",),  # type: ignore[misc]
              r"leaps by \+?(-?[\d.]+)", (2.4, 3.6)) for where in (0.1, 0.5, 0.9)
    ),
    Fault("-1 where nothing was seen", _sentinels, ("zeros", "outliers", "range")),
    Fault("two joints swapped", lambda g: spoilt.exchanged(g, "q_encoder", [1, 0]), ("swapped",)),
    Fault("measured in steps of 0.5", lambda g: coarse(g, 0.5), ("coarse",)),
    Fault("fast rows lost", lambda g: dropped(g, 0.3), ("missing",)),
    Fault("gaps filled by lines", lambda g: filled(g, 0.2), ("filled",)),
    Fault("one row in 100 wild", lambda g: wild(g, 0.01), ("outliers",)),
    Fault("one joint stands for a tenth", lambda g: spoilt.stuck(g, 1, 0.1), ("stuck",)),
)  # fmt: skip
PAYLOAD = Fault("payload changed half-way", lambda g: g, ("jump", "drift"))


def unknown_arms(only: str, folder: Path) -> Iterator[Outcome]:
    """Try each fault on every arm, those of even seeds and of odd ones apart; then untouched recordings."""
    for parity, seeds in (("even", SEEDS[::2]), ("odd", SEEDS[1::2])):
        for fault in (*FAULTS, PAYLOAD):
            if re.search(only, case := f"unknown arms, {parity} seeds: {fault.name}"):
                became = {seed: _became(seed, fault, folder) for seed in seeds}
                count = Counter(word.partition(":")[0] for word in became.values())
                wrong = [f"arm {seed} {word}" for seed, word in became.items() if word.startswith("silent")]
                claimed = "; ".join([", ".join(f"{n} {word}" for word, n in count.most_common()), *wrong])
                yield Outcome(case, claimed, f"{len(seeds)} arms", FAILS if wrong else HOLDS)
        if re.search(only, case := f"unknown arms, {parity} seeds: untouched"):
            of_seed = {seed: _alarms(Arm(seed)) for seed in seeds}
            wrong = [f"arm {seed}: {alarm}" for seed, alarms in of_seed.items() for alarm in alarms]
            claimed = "; ".join([f"{len(wrong)} refused", *wrong])
            yield Outcome(case, claimed, f"{len(seeds) * len(UNTOUCHED)} recordings", FAILS if wrong else HOLDS)


def _alarms(arm: Arm) -> list[str]:
    logs = (arm.moved(motion, seed, seconds, day=day).log for motion, seed, seconds, day in UNTOUCHED)
    return [str(finding) for log in logs for finding in findings_of(log) if finding.refuses]


def _became(seed: int, fault: Fault, folder: Path) -> str:
    """Return "named", "refused", "told" (an interval holds the delay), "claim holds", or "silent: " and by how much."""
    arm, motion = Arm(seed), MOTIONS[seed % len(MOTIONS)]
    log, again = arm.moved(motion, 1, SECONDS).log, [_true(arm.moved(motion, 11, SECONDS))]
    spoiled = fault.spoil(log)
    if fault is PAYLOAD:
        assert log.q_encoder is not None
        loaded = arm.moved(motion, 1, SECONDS, payload=True).log
        after = np.arange(len(log))[:, None] >= len(log) // 2
        tau = None if log.tau is None or loaded.tau is None else np.where(after, loaded.tau, log.tau)
        spoiled = replace(log, q_encoder=np.where(after, loaded.q_encoder, log.q_encoder), tau=tau)
        again.append(replace(_true(arm.moved(motion, 11, SECONDS, payload=True)), name="loaded"))
    return _named(fault, findings_of(spoiled)) or _claim(spoiled, again, folder)


def _true(moved: Moved) -> MotionLog:
    return replace(moved.log, q_encoder=moved.true)


def _named(fault: Fault, findings: Sequence[Finding]) -> str:
    """Return how findings name a fault; nothing where none does."""
    own = [f for f in findings if f.name in fault.named_by and (not f.joints or {"J1", "J2"} & {*f.joints})]
    for finding in own:
        size = re.search(fault.size, str(finding)) if fault.size else None
        if fault.delay is not None and finding.refuses and finding.delay is not None:
            apart, whole = dict(finding.delay.apart).get("J2", np.inf), finding.delay
            right = abs(apart - fault.delay) < 0.06 if fault.alone else whole.low <= fault.delay <= whole.high
        else:
            right = fault.delay is None and (
                not fault.size or (size is not None and _within(float(size[1]), fault.true))
            )
        if right:
            return "named"
    if any(finding.refuses for finding in findings):
        return "refused"
    delay = next((finding.delay for finding in findings if finding.delay is not None), None)
    if fault.delay is None or delay is None:
        return ""
    intervals = (
        [(low, high) for joint, low, high in delay.alone if joint == "J2"] if fault.alone else [(delay.low, delay.high)]
    )
    return "told" if any(_within(fault.delay, interval) for interval in intervals) else ""


def _within(number: float, interval: tuple[float, float]) -> bool:
    return interval[0] <= number <= interval[1]


def _claim(spoiled: MotionLog, again: Sequence[MotionLog], folder: Path) -> str:
    """Hold the errors that a fit states against the true ones, of other minutes."""
    model = folder / "model.npz"
    printed, text = run("fit", *written([spoiled], folder), "--model", "polynomial", "--out", model)
    if printed is None:
        return f"silent: fit refused, check did not: {text[:80]}"
    there = near(reported([spoiled]), reported(again))
    for rows, key in ((there, "rmse_high"), (~there, "rmse_margin")):
        if rows.mean() > FEW:
            stated = np.array([joint[key] for joint in printed["cross_validation"]], dtype=float)
            ratio = true_errors(model, again, rows)[0] / np.maximum(stated, LEAST)
            if ratio.max() > 1.0 + CLOSE:
                return f"silent: J{ratio.argmax() + 1} errs by {ratio.max():.2f} times what is stated"
    return "claim holds"
