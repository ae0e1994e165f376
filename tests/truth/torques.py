"""Recordings of torques with a known fault: the cause that is told beside the true one."""

import re
from collections.abc import Iterator

from catenary.identification.explanations.findings import torque_findings
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from known_torques import TRUTHS, Truth, drawn, known_torques
from tests.truth.bench import FAILS, HOLDS, NAMED, REFUSED, Outcome

FINDING = {
    "load": "arm", "shared drive": "arm", "gain": "torques", "common gain": "torques", "currents": "torques",
    "sign": "sign", "position sign": "sign", "backwards": "sign", "all signs": "sign", "zero": "offset",
    "no gravity": "gravity", "tilt": "gravity", "swapped": "swapped", "delay": "delay",
}  # fmt: skip


def torques(only: str) -> Iterator[Outcome]:
    """Try the truths whose name a regular expression finds."""
    yield from (_tried(truth) for truth in (*TRUTHS, *drawn()) if re.search(only, f"torques: {truth.name}"))


def _tried(truth: Truth) -> Outcome:
    model = load_robot(truth.robot)
    samples = prepare(known_torques(truth), model, IdentifyOptions(), within_limits=False)
    found = [each for each in torque_findings(model, samples) if each.name != "short"]
    told, true = [each.name for each in found[:1]], [] if truth.cause is None else [FINDING[truth.cause]]
    refused = any(each.refuses for each in found)
    verdict = (REFUSED if refused else NAMED if found else HOLDS) if told == true or not refused else FAILS
    said = str(found[0]).split("; log evidence")[0] if found else "nothing"
    return Outcome(f"torques: {truth.name}", said, truth.cause or "nothing", verdict)
