"""What the simulated RAVEN-II comes to beside every target, those it was fitted to and those it was not.

Peng et al., a real robot, and Lewis and Hannaford 2014, beside the nominal simulated robot, whose parameters were
fitted in three steps (`python -m papers.plant.refit`). Reached: within 15 % on every joint.
"""

from collections.abc import Sequence

import numpy as np

from catenary import Corrector
from catenary.arrays import Floats
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.trajectories.zigzag import DIRECTIONS, Direction
from papers.calibration import published
from papers.calibration.recordings import TEST_SECONDS, homed
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.kit import filled, table
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
    beside = f"RMSE | paper [{UNITS}] | reached | verdict"
    of_angle = "base [deg] | target [%] | DG, J1 [%] | SG, J1 [%] | DG calibrated, J1 [%] | DG, J2, J3 [%] | verdict"
    of_hour = f"RMSE | role | paper [{UNITS}] | reached | verdict"
    of_direction = f"RMSE | paper [{UNITS}] | reached, fresh robot | verdict | one after another"
    least, most = JOINT_1_FRICTION
    errors = [[name, *_against(target, found[name])] for found in o.of(table_1) for name, target in TARGETS.items()]
    static = [_static(told["base_deg"], found) for told, found in o.items(static_gravity)]
    tables = [
        table("Table I, direction J2-J3", beside, errors),
        table("Static gravity test", of_angle, static),
        table("Six hours of motion, unloaded and with 500 g", of_hour, _hours(o)),
        table("Every direction", of_direction, _directions(o)),
        table("Homing again from wherever a motion ended", f"homings | paper [{UNITS}] | reached", _homings(o)),
    ]
    friction = [
        f"Friction of joint 1 in all, under the torque that holds it on a level base: {found['friction_Nm']:.2f} Nm; "
        f"target {least} to {most} Nm."
        for found in o.of(static_gravity, base_deg=BASE_ANGLES_DEG[0])
    ]
    return Report(filled(tables), remarks=friction)


def _text(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def _against(target: Sequence[float], reached: Sequence[float]) -> list[str]:
    return [_text(target), _text(reached), verdict(reached, target)]


def _static(base_deg: float, found: Result) -> list[str]:
    tilted = base_deg == BASE_ANGLES_DEG[-1]
    good = found["dg"][0] < PD_SHARE_LIMIT and (not tilted or found["sg"][0] > STATIC_SHARE_LIMIT)
    target = f"DG < {PD_SHARE_LIMIT:.0f}" + (f", SG > {STATIC_SHARE_LIMIT:.0f}" if tilted else "")
    shares = (f"{found[name][0]:.1f}" for name in ("dg", "sg", "dg calibrated"))
    others = f"{found['dg'][1]:.0f}, {found['dg'][2]:.0f}"
    return [f"{base_deg:.0f}", target, *shares, others, "reached" if good else "not reached"]


def _hours(o: Outcomes) -> list[list[str]]:
    content = []
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
        found = o.of(hours, payload_kg=payload, trained_loaded=loaded)
        content += [[title, role, *_against(target, each[name])] for each in found]
    return content


def _directions(o: Outcomes) -> list[list[str]]:
    worn = next(iter(o.of(directions_in_turn)), {})
    return [
        [
            f"{told['direction']}, {name}",
            *_against(published.TABLE_1[told["direction"]][name], fresh[name]),
            _text(worn[told["direction"]][name]) if worn else "-",
        ]
        for told, fresh in o.items(fresh_direction)
        for name in ("raw", "fixed offset")
    ]


def _homings(o: Outcomes) -> list[list[str]]:
    content: list[list[str]] = []
    for found in o.of(after_homings):
        reached = np.array(found["errors"])
        for k, here in enumerate(reached):
            paper = {0: published.HOMINGS_LINEAR_J2[0], evaluation.HOMINGS: published.HOMINGS_LINEAR_J2[1]}.get(k)
            content.append([f"after {k}", "-" if paper is None else f"-, {paper:.3f}, -", _text(here)])
        for k, (name, values) in enumerate((("least", reached.min(axis=0)), ("greatest", reached.max(axis=0)))):
            paper_range = (published.HOMINGS_LINEAR_J1[k], published.HOMINGS_LINEAR_J2[k], published.HOMINGS_J3[k])
            content.append([f"{name} of all", _text(paper_range), _text(values)])
    return content


EXPERIMENT = Experiment(
    "plant-targets", "targets of the fit", "The simulated RAVEN-II: target against reached", __doc__,
    cases, report, minutes=5.0, drawn=0,
)  # fmt: skip
