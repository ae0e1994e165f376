"""Two computers' tables of one motion through `import`: the offset and rate of their clocks beside the true ones."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.drawn_arms.arm import Arm
from tests.truth.bench import FAILS, HOLDS, REFUSED, Outcome, run

CLOSE_S, CLOSE_PPM = 0.003, 3.0
CLOCKS = ((0.014, 0.0), (0.73, 50.0), (7200.0, 50.0), (-30.0, 300.0), (100.0, None))  # None: another motion
_SAID = re.compile(
    r"its clock is ([+-][\d.]+) s ahead of q_nominal's and gains ([+-][\d.]+) ppm \(([+-][\d.]+) to ([+-][\d.]+) s"
)


def two_computers(only: str, folder: Path) -> Iterator[Outcome]:
    """Import tables of arms that no threshold was set on."""
    for seed, motion in ((13, "random"), (17, "zigzag"), (21, "task")):
        for ahead, ppm in CLOCKS:
            fault = "nothing in common" if ppm is None else f"{ahead:g} s and {ppm:g} ppm apart"
            case = f"two computers: arm {seed}, {motion}: {fault}"
            if re.search(only, case):
                yield _imported(f"{case}: clocks of two computers", Arm(seed), motion, ahead, ppm, folder)


def _imported(case: str, arm: Arm, motion: str, ahead: float, ppm: float | None, folder: Path) -> Outcome:
    log, rows = arm.moved(motion, 5, 300.0).log, np.arange(0.3, 299.0, 1.0 / 30.0)
    other = log if ppm is not None else arm.moved("random", 6, 300.0).log
    assert log.time is not None
    assert other.time is not None
    assert other.q_encoder is not None
    seen = np.column_stack([np.interp(rows, other.time, column) for column in other.q_encoder.T])
    stamps = rows * (1.0 + 1e-6 * (ppm or 0.0)) + ahead
    for name, table in (("robot", [log.time, log.q_nominal]), ("camera", [stamps, seen])):
        head = ",".join(["t", *(f"J{j + 1} [{unit}]" for j, unit in enumerate(log.joint_units))])
        np.savetxt(folder / f"{name}.csv", np.column_stack(table), delimiter=",", header=head, comments="", fmt="%.9f")
    found, text = run("import", folder / "robot.csv", folder / "camera.csv", "--yes", "--out", folder / "both.parquet")
    true = "no motion in common" if ppm is None else f"{ahead:g} s, {ppm:g} ppm"
    if found is None or ppm is None:
        right = found is None and ppm is None and "--clock SECONDS,PPM" in text
        return Outcome(case, text.splitlines()[0] if found is None else "imported", true, REFUSED if right else FAILS)
    told = next((said for note in found["notes"] if (said := _SAID.search(note))), None)
    s, gains, low, high = map(float, told.groups()) if told else (0.0, 0.0, 0.0, 0.0)
    holds = abs(s - ahead) < CLOSE_S and abs(gains - ppm) < CLOSE_PPM and low - 1e-3 <= ahead <= high + 1e-3
    return Outcome(case, told[0] if told else "nothing", true, HOLDS if holds else FAILS)
