"""What the simulated RAVEN-II with friction comes to beside every target, those it was fitted to and those it was not.

Peng et al., a real robot, a recording of 2018, and Lewis and Hannaford 2014, beside the robot of
`raven2_friction.toml`, whose numbers `python -m papers.plant.refit` fitted. Reached: within 15 % on every joint.
"""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.control.pd import Damping
from catenary.simulation.cable_parameters import RAVEN2, RAVEN2_STIFF, load_cable_arm
from papers.calibration.recordings import METHODS, NETWORK, TEST_SECONDS, homed
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.gravity import published as gravity
from papers.gravity.raven_base import turned_base
from papers.gravity.tracking import CONTROLLERS, run_controllers
from papers.kit import JOINTS, filled, rounded, table
from papers.plant import evaluation
from papers.plant.targets import CLOSE, HELD_OUT, TARGETS

ROBOTS = {RAVEN2_STIFF: "of 2014", RAVEN2: "of 2018"}
UNITS = "deg, deg, mm"
DRAWN = (1, 2, 3)  # robots of the kind
# what the paper says of methods: the first errs by more
ORDERS = (("fixed offset", "linear"), ("linear", NETWORK))


@run(revision=1)
def methods(seed: int | None, test_seconds: float) -> Result:
    """Return the errors of every method in direction J2-J3, the mean over three test motions."""
    kinds = [name for name in METHODS if name in (*TARGETS, NETWORK)]
    errors = evaluation.errors_of(homed(seed), kinds, evaluation.TESTS, test_seconds)
    return {name: rounded(values) for name, values in errors.items()}


@run(revision=1)
def tilted_tracking(robot: str, base_deg: float) -> Result:
    """Return each controller's RMS errors [deg, deg, mm] where figure 9's motion is followed on a tilted base."""
    pairs: list[tuple[str, Damping]] = [(name, "absolute") for name in CONTROLLERS]
    runs = run_controllers(None, turned_base(base_deg), pairs, arm=load_cable_arm(robot), way="increments")
    return {one.controller: list(one.rms_error) for one in runs}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every target."""
    if scope.quick:
        return [methods.case(seed=None, test_seconds=120.0)]
    return [
        *(methods.case(seed=seed, test_seconds=TEST_SECONDS) for seed in (None, *DRAWN)),
        *(tilted_tracking.case(robot=robot, base_deg=gravity.LARGEST_BASE_DEG) for robot in ROBOTS),
    ]


def verdict(reached: Sequence[float] | Floats, target: Sequence[float]) -> str:
    """Say "reached", or which joints are off by how much."""
    off = np.asarray(reached) / np.asarray(target) - 1.0
    missed = [f"J{j + 1} {share:+.0%}" for j, share in enumerate(off) if abs(share) > CLOSE]
    return ", ".join(missed) or "reached"


def report(o: Outcomes) -> Report:
    """Return a table for every group of targets."""
    of_method = f"RMSE | role | paper [{UNITS}] | nominal robot | verdict | three drawn robots"
    of_order = "greater error | less | joint | nominal difference | of drawn robots | verdict"
    tables = [
        table("Errors of methods, direction J2-J3", of_method, _methods(o)),
        table("Orders of methods", of_order, _orders(o)),
        table(
            f"Gain of compensation, joint 1, base at {gravity.LARGEST_BASE_DEG} deg (figure 9)",
            "robot | PD [deg] | SG | DG | DG's gain | the paper's",
            _gains(o),
        ),
        table("Numbers that were fitted", "number | unit | values | plausible | why", _numbers()),
    ]
    return Report(filled(tables))


def _text(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def _of(o: Outcomes, name: str) -> list[Floats]:
    """Return a method's errors of the nominal robot (3,) and of drawn ones (robots, 3), as far as they have run."""
    by_seed = {args["seed"]: np.array(result[name]) for args, result in o.items(methods)}
    return [np.array([by_seed[seed] for seed in seeds if seed in by_seed]) for seeds in ((None,), DRAWN)]


def _methods(o: Outcomes) -> list[list[str]]:
    content = []
    for name, target in {**TARGETS, **HELD_OUT}.items():
        nominal, drawn = _of(o, name)
        role = "held out" if name in HELD_OUT else "fitted"
        texts = [_text(nominal[0]), verdict(nominal[0], target)] if len(nominal) else ["-", "-"]
        content.append([name, role, _text(target), *texts, _text(drawn.mean(axis=0)) if len(drawn) else "-"])
    return content


def _orders(o: Outcomes) -> list[list[str]]:
    content = []
    for greater, less in ORDERS:
        nominal, drawn = (a - b for a, b in zip(_of(o, greater), _of(o, less), strict=True))
        if not len(nominal) or len(drawn) < 2:
            continue
        for j, joint in enumerate(JOINTS):
            mean, spread = drawn[:, j].mean(), drawn[:, j].std(ddof=1)
            holds = nominal[0, j] > 0.0 and mean > 0.0
            text = ("beyond the spread" if mean > spread else "holds") if holds else "does not hold"
            content.append([greater, less, joint, f"{nominal[0, j]:.3f}", f"{mean:.3f} ± {spread:.3f}", text])
    return content


def _gains(o: Outcomes) -> list[list[str]]:
    content = []
    for args, result in o.items(tilted_tracking):
        plain, level, sensed = (result[name][0] for name in CONTROLLERS)
        errors = (f"{error:.3f}" for error in (plain, level, sensed))
        gain = 100.0 * (1.0 - sensed / plain)
        content.append([ROBOTS[args["robot"]], *errors, f"{gain:.1f} %", f"{gravity.GAIN_PERCENT:.0f} %"])
    return content


def _numbers() -> list[list[str]]:
    def digits(values: list[float]) -> str:
        return ", ".join(f"{value:.4g}" for value in values)

    file = load_cable_arm().file
    return [
        [
            f"`{name}`",
            entry.unit,
            digits(entry.value),
            f"{digits(entry.least)} to {digits(entry.most)}",
            entry.note or "",
        ]
        for entries in (file.cable, file.rig)
        for name, entry in entries.items()
        if entry.least is not None and entry.most is not None and entry.origin == "fitted"
    ]


EXPERIMENT = Experiment(
    "plant-targets", "targets of the fit", "The simulated RAVEN-II with friction: target against reached", __doc__,
    cases, report, minutes=5.0, drawn=0,
)  # fmt: skip
