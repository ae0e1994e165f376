"""Recordings of torques with a known fault: the cause that is told beside the true one."""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from catenary.identification.explanations.findings import explained_torques
from catenary.identification.identification import Identification, identify_samples
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.payload import estimate_payload
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from known_torques import TRUTHS, Truth, drawn, known_torques
from tests.truth.bench import FAILS, HOLDS, NAMED, REFUSED, Outcome

FINDING = {
    "load": "arm", "shared drive": "arm", "gain": "torques", "common gain": "torques", "currents": "torques",
    "sign": "sign", "position sign": "sign", "backwards": "sign", "all signs": "sign", "zero": "offset",
    "no gravity": "gravity", "tilt": "gravity", "swapped": "swapped", "delay": "delay", "velocities": "velocities", "late velocities": "velocities",
    "zero leaps": "jump", "sign turns": "jump", "load changes": "jump",
}  # fmt: skip


def torques(only: str) -> Iterator[Outcome]:
    """Try the truths whose name a regular expression finds."""
    yield from (_tried(truth) for truth in (*TRUTHS, *drawn()) if re.search(only, f"torques: {truth.name}"))


def payloads(only: str) -> Iterator[Outcome]:
    """Weigh loads of 0, .5 and 2 kg by identified arms, beside one kind of difference each."""
    for robot, kind in product(_PAYLOAD_ROBOTS, _BESIDE):
        if re.search(only, name := f"payload: {robot}, {kind}"):
            weighings = [_weighed(robot, kind, draw) for draw in range(_PAYLOAD_DRAWS)]
            inside = sum(within for within, _ in weighings)
            right = sum(is_detected for _, is_detected in weighings)
            claim = f"{inside} in 95 %, {right} told apart"
            # of sharp intervals one in twenty lies outside: three of twelve once in fifty tables
            holds = inside >= _PAYLOAD_DRAWS - 2 and right >= _PAYLOAD_DRAWS - 1
            yield Outcome(name, claim, f"{_PAYLOAD_DRAWS} loads", HOLDS if holds else FAILS)


_PAYLOAD_ROBOTS, _PAYLOAD_DRAWS, _LOADS_KG = ("ur10e", "gen3", "iiwa14"), 12, (2.0, 0.0, 0.5)
_BESIDE = ("nothing else", "one gain 5 %", "all gains 5 %", "tilt 3 deg", "zeros", "friction")
_PLACE = (0.0, 0.0, 0.05)  # [m] of the load, from the tip
_ZERO_NM, _SMALL_JOINT_SIGMAS = 5.0, 3.0  # of the zeros, and of the joint's usual residual over the largest at most


@cache
def _identified(robot: str) -> Identification:
    model = load_robot(robot)
    log = known_torques(Truth("free", None, robot=robot, seed=21))
    return identify_samples([prepare(log, model, IdentifyOptions(), within_limits=False)], model, IdentifyOptions())


def _weighed(robot: str, kind: str, draw: int) -> tuple[bool, bool]:
    """Return whether a load lies in its interval, and whether it was told that there is one or none."""
    arm, rng = _identified(robot), np.random.default_rng([draw, _BESIDE.index(kind)])
    n, kg, tilt = arm.model.n, _LOADS_KG[draw % 3], np.deg2rad(3.0)
    around, factor = rng.uniform(0.0, 2.0 * np.pi), 1.0 + 0.05 * rng.choice([-1.0, 1.0])
    how: dict[str, Any] = {
        "one gain 5 %": {"gain": np.where(np.arange(n) == rng.integers(n), factor, 1.0)},
        "all gains 5 %": {"gain": factor},
        "tilt 3 deg": {
            "gravity": 9.81 * np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), -np.cos(tilt)])
        },
        "friction": {"friction": float(rng.uniform(0.7, 1.4))},
    }.get(kind, {})
    seed = 5001 + draw + 100 * _BESIDE.index(kind)
    load = (kg, _PLACE) if kg else None
    log = known_torques(Truth("loaded", None, robot=robot, seed=seed, seconds=20.0, load=load, **how))
    if kind == "zeros":
        size = _ZERO_NM * np.minimum(1.0, _SMALL_JOINT_SIGMAS * arm.usual / arm.usual.max())
        shifted = rng.permutation(n) < rng.integers(1, 4)
        log = replace(log, tau=log.tau + shifted * size * rng.choice([-1.0, 1.0], n))
    samples = prepare(log, arm.model, arm.options, within_limits=False)
    estimate = estimate_payload(arm, [samples], at=(arm.model.tip, _PLACE))
    within = estimate.mass is not None and abs(estimate.mass - kg) < 1.96 * (estimate.mass_std or 0.0)
    return within, estimate.detected == (kg > 0.0)


def _tried(truth: Truth) -> Outcome:
    model = load_robot(truth.robot)
    samples = prepare(known_torques(truth), model, IdentifyOptions(), within_limits=False)
    findings = [each for each in explained_torques(model, samples)[0] if each.name != "short"]
    names, true = [each.name for each in findings[:1]], [] if truth.cause is None else [FINDING[truth.cause]]
    refused = any(each.refuses for each in findings)
    verdict = (REFUSED if refused else NAMED if findings else HOLDS) if names == true or not refused else FAILS
    claim = str(findings[0]).split("; log evidence")[0] if findings else "nothing"
    return Outcome(f"torques: {truth.name}", claim, truth.cause or "nothing", verdict)
