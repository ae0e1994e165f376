"""Tables whose truth is known through `import` and `check`: arms at rest, joints called as quantities, units, no numbers."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot
from tests.truth.bench import FAILS, HOLDS, REFUSED, Outcome, run

T = np.arange(0.0, 12.0, 0.02)
# robot, positions, numbers of the first and last joint, and what else moves in the log of a make
MAKES = {
    "UR": ("ur5e", "actual_q_{}", range(6), "joint_temperatures_{} actual_joint_voltage_{} actual_current_{} "
           "actual_digital_input_bits actual_execution_time actual_main_voltage actual_robot_voltage actual_momentum"),
    "Franka": ("panda", "q_{}", range(7), "tau_J_{} O_T_EE_{} control_command_success_rate"),
    "Kinova": ("gen3", "position_{}", range(7), "torque_{} current_motor_{} voltage_{} temperature_motor_{}"),
    "xArm": (None, "J{}", range(1, 8), "temp{} voltage{} current{}"),
}  # fmt: skip
NO_NUMBER = ("-9999", "-999", "-3.697314E28", "1.#QNAN", "-1.#IND", "1e30", "65535")
DEGREES = np.array([57.29577951308232, 57.29577951308232, 1e3, *[57.29577951308232] * 3])


def imports(folder: Path) -> Iterator[Outcome]:
    """Import and check tables of which every number is known."""
    for make, (robot, position, numbers, others) in MAKES.items():
        for moving in ((), (2,), tuple(range(7))):
            q = {position.format(j): 0.1 * k + 0.3 * np.sin(T + k) * (k in moving) for k, j in enumerate(numbers)}
            rng = np.random.default_rng(len(moving))
            noise = {
                name.format(j): 48.0 + np.cumsum(0.05 * rng.normal(size=len(T)))
                for name in others.split()
                for j in numbers
            }
            yield _imported(
                f"{make} with {len(moving)} joints moving: joints among temperatures and voltages",
                folder,
                noise | q,
                q,
                robot,
            )
    for number in NO_NUMBER:
        q = {f"{name}{j}": np.sin(T + j) + 0.01 * (name == "cam") for name in ("q", "cam") for j in (1, 2, 3)}
        cells = q | {"cam2": np.where(np.arange(len(T)) % 50 == 7, number, q["cam2"].astype("<U24"))}
        yield _imported(f"{number} in one row of 50: numbers that mean missing", folder, cells, q, None)
    for reach, stated in ((r, s) for r in ({}, {4: 2.97}, {2: 0.55}) for s in (True, False)):
        for scale in (np.ones(6), DEGREES) if not reach else (np.ones(6),):
            yield _advised(folder, reach, scale, stated=stated)


def _imported(
    name: str, folder: Path, columns: dict[str, np.ndarray], true: dict[str, np.ndarray], robot: str | None
) -> Outcome:
    path, out = folder / "table.csv", folder / "table.parquet"
    rows = zip(*({"t": T} | columns).values(), strict=True)
    path.write_text("\n".join([",".join(["t", *columns]), *(",".join(map(str, row)) for row in rows)]))
    options = ("--robot", robot) if robot else ()
    found, said = run("import", path, "--yes", "--units", "rad", *options, "--out", out)
    if found is None:
        return Outcome(f"import: {name}", said.splitlines()[0], "", f"{FAILS}: refused")
    log, values = read_log(out), np.column_stack([*true.values()])
    n, what = log.q_nominal.shape[1], "" if log.q_encoder is None else " beside a measurement"
    off = [np.abs(log.q_nominal - values[:, :n]).max() if n <= values.shape[1] else np.inf]
    off += [] if log.q_encoder is None else [np.abs(log.q_encoder - values[:, n:])[log.ok].max()]
    holds = max(off) < 1e-6 and log.ok.mean() > 0.9 and 2 * n >= values.shape[1]
    return Outcome(
        f"import: {name}",
        f"{n} joints{what}, {int(log.ok.sum())} rows",
        f"off {max(off):.2g}",
        HOLDS if holds else FAILS,
    )


def _advised(folder: Path, reach: dict[int, float], scale: np.ndarray, *, stated: bool) -> Outcome:
    """Check a PSM's log in the layout whose units a file may state; other units are right only where it states none."""
    model = load_robot("dvrk_psm")
    farthest = 0.6 * model.upper
    farthest[[*reach]] = [*reach.values()]
    q = scale * farthest * np.sin(np.outer(T, 1.0 + 0.17 * np.arange(6)))
    q[:, 2] = np.abs(q[:, 2])
    said = {"units": np.array(model.joint_units), "joint_names": np.array(model.joint_names)} if stated else {}
    path = folder / "units.npz"
    np.savez(path, q_des=q, q_act=1.01 * q, ok=np.ones(len(T), dtype=bool), t=T, **said)
    found, text = run("check", path, "--robot", "dvrk_psm")
    told = [f for f in (found or {}).get("findings", ()) if f["name"] in ("units", "range")]
    advice = " ".join(f["remedy"] or f["name"] for f in told) or "nothing" if found else text
    wrong = scale is DEGREES
    right = "--units deg,deg,mm,deg,deg,deg" if wrong and not stated else "range" if wrong or reach else "nothing"
    case = f"units: PSM in {'deg, mm' if wrong else 'rad, m'}, {reach or 'within limits'}, {'' if stated else 'not '}stated: units of a PSM, at its limits and beyond"
    return Outcome(case, advice, right, (REFUSED if told else HOLDS) if advice == right else FAILS)
