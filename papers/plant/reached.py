"""What the simulated RAVEN-II comes to beside every target, those it was fitted to and those it was not.

Peng et al., a real robot, and Lewis and Hannaford 2014, beside the nominal simulated robot, whose parameters were
fitted in three steps (`python -m papers.plant.refit`). Reached: within 15 % on every joint.
"""

from collections.abc import Sequence

import numpy as np

from catenary import Corrector
from catenary.arrays import Floats
from catenary.reports.page import Table
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.trajectories.zigzag import DIRECTIONS, Direction
from papers.calibration import published
from papers.calibration.recordings import TEST_SECONDS, homed
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, TitledTable, run
from papers.plant import evaluation
from papers.plant.pd_share import BASE_ANGLES_DEG, pd_share
from papers.plant.targets import CLOSE, JOINT_1_FRICTION, PD_SHARE_LIMIT, STATIC_SHARE_LIMIT, TARGETS, joint_1_friction

UNITS = "deg, deg, mm"
PAYLOAD = 0.5  # [kg]


def _plain(values: dict[str, Floats]) -> dict[str, list[float]]:
    return {name: [float(value) for value in array] for name, array in values.items()}


@run(revision=1)
def table_1(test_seconds: float) -> Result:
    """Return the errors of direction J2-J3, the mean over three test motions."""
    return _plain(evaluation.mean_errors(load_cable_arm(), test_seconds))


@run(revision=1)
def static_gravity(base_deg: float) -> Result:
    """Return PD's share of the holding torque [%] with sensed and level gravity, and with calibrated positions."""
    arm = load_cable_arm()
    corrector = Corrector(evaluation.offset_model(evaluation.recordings(homed(None, arm=arm))[0]))
    sensed, level = pd_share(arm, base_deg, sensed=True), pd_share(arm, base_deg, sensed=False)
    calibrated = pd_share(arm, base_deg, sensed=True, corrector=corrector)
    return {
        **_plain({"dg": sensed.share, "sg": level.share, "dg calibrated": calibrated.share}),
        "friction_Nm": joint_1_friction(arm, float(sensed.torque[0])),
    }


@run(revision=1)
def hours(payload_kg: float, trained_loaded: bool) -> Result:
    """Return the linear model's errors and the fixed offset's in hours 0 and 5 of six."""
    first, last = evaluation.six_hours(load_cable_arm(), payload_kg, trained_loaded=trained_loaded)
    return _plain({"0": first.linear, "5": last.linear, "offset 0": first.offset, "offset 5": last.offset})


@run(revision=1)
def fresh_direction(direction: Direction, test_seconds: float) -> Result:
    """Return errors along a direction on a robot just homed, every direction with the same test motion."""
    return _plain(evaluation.direction_errors(load_cable_arm(), direction, test_seconds))


@run(revision=1)
def directions_in_turn() -> Result:
    """Return errors of all directions on one robot that wears, each with a test motion of its own."""
    return {name: _plain(found) for name, found in evaluation.errors_in_turn(load_cable_arm()).items()}


@run(revision=1)
def after_homings(count: int) -> Result:
    """Return the linear model's errors before and after each of some homings, none seen in training."""
    return {"errors": [[float(value) for value in found] for found in evaluation.homings(load_cable_arm(), count)]}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every target."""
    if scope.quick:
        return [table_1.case(test_seconds=120.0), after_homings.case(count=1)]
    return [
        table_1.case(test_seconds=TEST_SECONDS),
        *(static_gravity.case(base_deg=angle) for angle in BASE_ANGLES_DEG),
        hours.case(payload_kg=0.0, trained_loaded=True),
        hours.case(payload_kg=PAYLOAD, trained_loaded=True),
        hours.case(payload_kg=PAYLOAD, trained_loaded=False),
        *(fresh_direction.case(direction=each, test_seconds=TEST_SECONDS) for each in DIRECTIONS),
        directions_in_turn.case(),
        after_homings.case(count=evaluation.HOMINGS),
    ]


def verdict(reached: Sequence[float], target: Sequence[float]) -> str:
    """Say "reached", or which joints are off by how much."""
    off = np.asarray(reached) / np.asarray(target) - 1.0
    missed = [f"J{j + 1} {share:+.0%}" for j, share in enumerate(off) if abs(share) > CLOSE]
    return ", ".join(missed) or "reached"


def report(o: Outcomes) -> Report:
    """Return a table for every group of targets."""
    tables = []
    for title, made in (
        ("Table I, direction J2-J3", _table_1),
        ("Static gravity test", _static_gravity),
        ("Six hours of motion, unloaded and with 500 g", _hours),
        ("Every direction", _directions),
        ("Homing again from wherever a motion ended", _homings),
    ):
        table = made(o)
        if table.rows:
            tables.append(TitledTable(title, table))
    return Report(tables, remarks=_friction(o))


def _table_1(o: Outcomes) -> Table:
    rows = [
        [name, _text(target), _text(found[name]), verdict(found[name], target)]
        for found in o.of(table_1)
        for name, target in TARGETS.items()
    ]
    return Table(["RMSE", f"paper [{UNITS}]", "reached", "verdict"], rows)


def _static_gravity(o: Outcomes) -> Table:
    rows = []
    for told, found in o.items(static_gravity):
        tilted = told["base_deg"] == BASE_ANGLES_DEG[-1]
        good = found["dg"][0] < PD_SHARE_LIMIT and (not tilted or found["sg"][0] > STATIC_SHARE_LIMIT)
        rows.append(
            [
                f"{told['base_deg']:.0f}",
                f"DG < {PD_SHARE_LIMIT:.0f}" + (f", SG > {STATIC_SHARE_LIMIT:.0f}" if tilted else ""),
                *(f"{found[name][0]:.1f}" for name in ("dg", "sg", "dg calibrated")),
                f"{found['dg'][1]:.0f}, {found['dg'][2]:.0f}",
                "reached" if good else "not reached",
            ]
        )
    names = ["DG, J1 [%]", "SG, J1 [%]", "DG calibrated, J1 [%]", "DG, J2, J3 [%]"]
    return Table(["base [deg]", "target [%]", *names, "verdict"], rows)


def _friction(o: Outcomes) -> list[str]:
    least, most = JOINT_1_FRICTION
    return [
        f"Friction of joint 1 in all, under the torque that holds it on a level base: {found['friction_Nm']:.2f} Nm; "
        f"target {least} to {most} Nm."
        for found in o.of(static_gravity, base_deg=BASE_ANGLES_DEG[0])
    ]


def _hours(o: Outcomes) -> Table:
    rows = []
    for payload, loaded, name, role, target in (
        (0.0, True, "0", "checked", published.SIX_HOURS_LINEAR[0]),
        (0.0, True, "5", "fitted", published.SIX_HOURS_LINEAR[1]),
        (0.0, True, "offset 0", "checked", published.SIX_HOURS_OFFSET[0]),
        (0.0, True, "offset 5", "checked", published.SIX_HOURS_OFFSET[1]),
        (PAYLOAD, True, "0", "checked", published.LOADED_LINEAR_HOUR_0),
        (PAYLOAD, True, "5", "checked", published.LOADED_LINEAR_HOUR_5),
        (PAYLOAD, False, "0", "checked", published.LOADED_LINEAR_HOUR_0),
        (PAYLOAD, False, "5", "checked", published.LOADED_LINEAR_HOUR_5),
    ):
        model, _, hour = name.rpartition(" ")
        title = f"{'fixed offset' if model else 'linear'}, {'500 g, ' if payload else ''}hour {hour}"
        title += "" if loaded else ", trained without load"
        for found in o.of(hours, payload_kg=payload, trained_loaded=loaded):
            rows.append([title, role, _text(target), _text(found[name]), verdict(found[name], target)])
    return Table(["RMSE", "role", f"paper [{UNITS}]", "reached", "verdict"], rows)


def _directions(o: Outcomes) -> Table:
    worn = next(iter(o.of(directions_in_turn)), {})
    rows = []
    for told, fresh in o.items(fresh_direction):
        direction = told["direction"]
        for name in ("raw", "fixed offset"):
            target = published.TABLE_1[direction][name]
            in_turn = _text(worn[direction][name]) if worn else "-"
            here = fresh[name]
            rows.append([f"{direction}, {name}", _text(target), _text(here), verdict(here, target), in_turn])
    header = ["RMSE", f"paper [{UNITS}]", "reached, fresh robot", "verdict", "one after another"]
    return Table(header, rows)


def _homings(o: Outcomes) -> Table:
    rows: list[list[str]] = []
    for found in o.of(after_homings):
        reached = np.array(found["errors"])
        for k, here in enumerate(reached):
            paper = {0: published.HOMINGS_LINEAR_J2[0], evaluation.HOMINGS: published.HOMINGS_LINEAR_J2[1]}.get(k)
            rows.append([f"after {k}", "-" if paper is None else f"-, {paper:.3f}, -", _text(here)])
        for k, (name, values) in enumerate((("least", reached.min(axis=0)), ("greatest", reached.max(axis=0)))):
            paper_range = (published.HOMINGS_LINEAR_J1[k], published.HOMINGS_LINEAR_J2[k], published.HOMINGS_J3[k])
            rows.append([f"{name} of all", _text(paper_range), _text(values)])
    return Table(["homings", f"paper [{UNITS}]", "reached"], rows)


def _text(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


EXPERIMENT = Experiment(
    "plant-targets", "targets of the fit", "The simulated RAVEN-II: target against reached", __doc__,
    cases, report, minutes=5.0, drawn=0,
)  # fmt: skip
