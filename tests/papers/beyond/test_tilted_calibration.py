import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import FixedBase, MotionLog, load_robot, potential_energy
from catenary.errors import InputError
from papers.beyond import tilted_calibration
from papers.beyond.bases import AXES, BASES, DIFFERENCE, GRAVITY, LEVEL_BASE, SetBase, with_gravity
from papers.beyond.tilted_calibration import KINDS, LEVEL, PAPERS, SEVERAL, TRAININGS, WITH_GRAVITY
from papers.experiment import NOMINAL, Outcomes, Scope

RNG = np.random.default_rng(0)
ARM = load_robot("raven2")


def log(rows: int = 5) -> MotionLog:
    q = RNG.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (rows, 3))
    return MotionLog(
        "made up", AXES, ("rad", "rad", "m"), q, np.ones(rows, bool),
        time=np.linspace(0.0, 1.0, rows), tau=RNG.uniform(-1.0, 1.0, (rows, 3)),
    )  # fmt: skip


@pytest.mark.parametrize("base", BASES)
def test_gravity_among_the_inputs_is_the_slope_of_potential_energy(base: str) -> None:
    recorded, start, h = log(), 3.0, 1e-6
    samples = BASES[base].sample(start + recorded.time)
    gravity = np.broadcast_to(
        samples.gravity, (5, 3)
    )  # the origin is on the axis of rocking: no acceleration
    found = with_gravity(recorded, BASES[base], start)
    for j, name in enumerate(GRAVITY):
        step = h * np.eye(3)[j]
        slope = [
            (potential_energy(ARM, q + step, g) - potential_energy(ARM, q - step, g)) / (2.0 * h)
            for q, g in zip(recorded.q_nominal, gravity, strict=True)
        ]
        assert_allclose(found.signals[name], slope, atol=1e-6)  # central difference
        assert_allclose(found.signals[name] + found.signals[DIFFERENCE[j]], recorded.tau[:, j], atol=1e-12)


def test_a_recording_without_time_has_no_gravity() -> None:
    still = MotionLog("still", AXES, ("rad", "rad", "m"), np.zeros((2, 3)), np.ones(2, bool))
    with pytest.raises(InputError, match="no time"):
        with_gravity(still, FixedBase(), 0.0)


def test_a_base_that_is_set_has_a_row_for_every_time() -> None:
    base = SetBase()
    assert_allclose(base.sample(np.zeros(3)).gravity, [[0.0, 0.0, -9.81]] * 3)
    base.now = BASES["20° across"]
    samples = base.sample(np.zeros(4))
    assert samples.motion.shape == (4, 3, 3)
    assert_allclose(samples.gravity[:, 2], -9.81 * np.cos(np.deg2rad(20.0)))


def made_up(with_gravity_on_tilts: float) -> Outcomes:
    results = {}
    for case in tilted_calibration.cases(Scope(robots=(NOMINAL, 1))):
        helps = GRAVITY[0] in case.arguments["inputs"]
        error = with_gravity_on_tilts if helps else 0.3
        methods = (*KINDS, "raw", "fixed offset")
        results[case] = {
            base: {**{method: [error] * 3 for method in methods}, "outside": 0.5} for base in BASES
        }
    return Outcomes(results)


def test_every_training_is_told_from_the_others() -> None:
    outcomes = made_up(0.1)
    for training in TRAININGS:
        for inputs, error in ((PAPERS, 0.3), (WITH_GRAVITY, 0.1)):
            reached = tilted_calibration.errors(outcomes, training, inputs, LEVEL_BASE, "network")
            assert_allclose(reached, np.full((2, 3), error))


def test_report_has_a_row_per_training_inputs_and_model() -> None:
    report = tilted_calibration.report(made_up(0.1))
    rows = len(TRAININGS) * (2 * len(KINDS) + 1)  # and the fixed offset
    assert [len(one.table.rows) for one in report.tables] == [rows] * 3
    assert "by 0.100/0.100/0.100 with the gravity model's torque" in report.remarks[0]
    assert len(report.pictures[0].figure.axes) == 3


def test_all_trainings_take_the_same_minutes() -> None:
    sparsities = [sorted(s for _, s in parts) for parts in TRAININGS.values()]
    assert sparsities[0] == sparsities[1] == sparsities[2]
    assert {base for base, _ in TRAININGS[SEVERAL]} > {LEVEL}
