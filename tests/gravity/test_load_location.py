import warnings
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.estimator import RecursiveGravityEstimator
from catenary.gravity.load_location import LoadHypotheses
from catenary.gravity.payload import Payload, load_directions
from catenary.gravity.torque import gravity_torque
from catenary.identification.payload import locate_load
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

UPRIGHT = np.array([0.0, 0.0, -9.81])
PLANAR = load_robot("planar_3r")
NOISE = 0.05
LOADED = Payload(0.8, "link3", (0.05, 0.0, 0.0)).on(PLANAR)


def torques(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return gravity_torque(LOADED, q, UPRIGHT) + NOISE * rng.normal(size=q.shape)


def poses(rng: np.random.Generator, count: int = 12) -> np.ndarray:
    return rng.uniform(-1.2, 1.2, size=(count, 3))


def upright_second_joint() -> RobotModel:
    """A link that pitches, and on it one that turns about an axis which stands upright while the first lies level."""
    body = LinkInertia(1.0, np.array([0.3, 0.0, 0.0]), 0.02 * np.eye(3))
    rows = [("lower", "base", [0.0, 1.0, 0.0], 0.0), ("upper", "lower", [0.0, 0.0, 1.0], 0.4)]
    links = [
        Link(name, parent, "revolute", Pose(np.eye(3), np.array([x, 0.0, 0.0])), np.array(axis),
             {f"{name} joint": 1.0}, inertia=body)
        for name, parent, axis, x in rows
    ]  # fmt: skip
    return assemble("made", links, [Coordinate(f"{name} joint", "rad") for name, *_ in rows])


ARM = upright_second_joint()
CARRYING = Payload(1.0, "upper", (0.15, 0.0, 0.0)).on(ARM)


def held(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return gravity_torque(CARRYING, q, UPRIGHT) + NOISE * rng.normal(size=q.shape)


def columns(q: np.ndarray, frame: str) -> np.ndarray:
    regressor = compact_regressor(ARM)
    return regressor.Z(q, UPRIGHT).reshape(-1, len(regressor.labels)) @ load_directions(regressor, frame)


def test_links_whose_columns_coincide_share_the_probability(rng: np.random.Generator) -> None:
    q = np.zeros((6, 2))
    lower, upper = (columns(q, frame) for frame in ("lower", "upper"))
    both = np.hstack([lower, upper])
    assert np.linalg.matrix_rank(both) == np.linalg.matrix_rank(lower) == np.linalg.matrix_rank(upper)
    found = locate_load(ARM, q, held(q, rng), UPRIGHT, noise=NOISE)
    assert 0.2 < found.no_load < 0.9  # in one pose a zero of torque looks the same
    assert_allclose(found.no_load + sum(one.probability for one in found.carriers), 1.0)
    # not quite halves: what is likely beforehand of a moment counts about each frame's own origin
    assert max(one.probability for one in found.carriers) < 0.8
    assert set(found.likely) == {"lower", "upper"}
    assert found.telling_joint == "upper joint"
    carried = found._replace(no_load=0.0)
    assert str(carried).endswith("cannot be distinguished by these poses; move upper joint")


def test_after_a_pose_that_tells_one_link_wins(rng: np.random.Generator) -> None:
    q = np.vstack([np.zeros((6, 2)), [[0.0, 0.8]]])
    found = locate_load(ARM, q, held(q, rng), UPRIGHT, noise=NOISE)
    first = found.carriers[0]
    assert found.likely == ("upper",)
    assert str(found) == "on upper"
    assert first.probability > 0.95
    assert first.mass == pytest.approx(1.0, abs=4.0 * first.mass_std)


def test_on_line_a_load_is_shared_until_a_pose_tells(rng: np.random.Generator) -> None:
    estimator = RecursiveGravityEstimator(
        ARM, noise=NOISE, settle=0.0, interval=0.0, novelty=0.0, carriers=("lower", "upper")
    )
    rest = np.zeros(2)
    learnt = rng.uniform(-1.0, 1.0, size=(30, 2))
    for k, q in enumerate(learnt):
        estimator.update(q, rest, gravity_torque(ARM, q, UPRIGHT), UPRIGHT, float(k))
    assert estimator.load is None
    told = []
    for k, q in enumerate(np.array([[0.0, 0.0]] * 4 + [[0.0, 0.8], [0.0, -0.8]])):
        estimator.update(q, rest, gravity_torque(CARRYING, q, UPRIGHT), UPRIGHT, 40.0 + k)
        assert estimator.load is not None
        told.append(set(estimator.load.likely))
    assert told[3] == {"lower", "upper"}
    assert told[5] == {"upper"}


def test_what_is_surely_stated_on_line_is_right_of_small_loads_too(rng: np.random.Generator) -> None:
    """A load that is no surprise in its first pose, or comes just after a false alarm, is not put on a wrong link."""
    panda, right = load_robot("panda"), []
    for _ in range(60):
        frame = str(rng.choice(panda.link_names))
        loaded = Payload(float(np.exp(rng.uniform(-2.3, 0.0))), frame, rng.uniform(-0.12, 0.12, 3)).on(panda)
        estimator = RecursiveGravityEstimator(
            panda, noise=0.1, settle=0.0, interval=0.0, novelty=0.0, forgetting=1.0, margin=-1.0,
            carriers=panda.link_names,
        )  # fmt: skip
        for k, q in enumerate(rng.uniform(panda.lower, panda.upper, (45, 7))):
            tau = gravity_torque(panda if k < 25 else loaded, q, UPRIGHT) + 0.1 * rng.normal(size=7)
            estimator.update(q, np.zeros(7), tau, UPRIGHT, float(k))
            if k % 3 == 0 and (load := estimator.load) is not None and load.no_load < 0.5:
                assert k >= 25
                first = load.carriers[0]
                if first.probability > 0.99:
                    right.append(first.frame == frame)
    assert len(right) > 120
    assert np.mean(right) > 0.985


def test_evidence_is_that_of_the_whole_gaussian_over_all_sizes(rng: np.random.Generator) -> None:
    q = poses(rng, 2)
    light = Payload(0.025, "link2", (0.05, 0.0, 0.0)).on(PLANAR)  # no hypothesis is out of the question
    tau = gravity_torque(light, q, UPRIGHT) + NOISE * rng.normal(size=q.shape)
    regressor = compact_regressor(PLANAR)
    Z = regressor.Z(q, UPRIGHT).reshape(-1, 3) / NOISE
    y = (tau - gravity_torque(PLANAR, q, UPRIGHT)).ravel() / NOISE
    sizes = np.array([2.0, 0.3, 0.3, 0.3])
    logs = []
    for frame in PLANAR.link_names:
        densities = []
        for octave, moment in product(range(7), (1.0, 0.5, 0.25)):
            V = Z @ load_directions(regressor, frame) * sizes * [1.0, moment, moment, moment]
            covariance = np.eye(len(y)) + V @ V.T / 4.0**octave
            fit = y @ np.linalg.solve(covariance, y) + np.linalg.slogdet(covariance)[1]
            densities.append(np.exp(-0.5 * fit))
        logs.append(np.log(np.mean(densities)))
    logs.append(-0.5 * y @ y)
    expected = np.exp(np.array(logs) - max(logs))
    hypotheses = LoadHypotheses(regressor, PLANAR.link_names)
    for rows, torque in zip(Z.reshape(2, 3, -1), y.reshape(2, 3), strict=True):
        hypotheses.take(rows, torque)
    none, *shares = hypotheses.shares()
    reached = [*shares, none]
    assert min(reached) > 1e-3
    assert_allclose(reached, expected / expected.sum(), rtol=1e-6, atol=1e-12)


def test_stated_probabilities_are_how_often_they_are_right(rng: np.random.Generator) -> None:
    regressor = compact_regressor(PLANAR)
    hypotheses = LoadHypotheses(regressor, PLANAR.link_names)
    stated, right = [], []
    for _ in range(600):
        q = poses(rng, 2)
        link = rng.integers(3)
        sizes = np.array([2.0, 0.3, 0.3, 0.3]) * 0.5 ** rng.integers(7)
        load = rng.normal(size=4) * sizes * np.append(1.0, np.full(3, 0.5 ** rng.integers(3)))
        Z = regressor.Z(q, UPRIGHT) / NOISE
        change = load_directions(regressor, PLANAR.link_names[link]) @ load
        hypotheses.restart(None)
        for row in Z:
            hypotheses.take(row, row @ change + rng.normal(size=3))
        shares = np.array(hypotheses.shares()[1:])
        stated.append(shares.max() / shares.sum())
        right.append(np.argmax(shares) == link)
    order = np.argsort(stated)
    for part in np.array_split(order, 3):  # the least sure third, the next, the surest
        p = np.array(stated)[part]
        # three standard deviations of a share
        assert np.mean(np.array(right)[part]) == pytest.approx(
            p.mean(), abs=3.0 * float(np.sqrt(np.sum(p * (1.0 - p)))) / len(p) + 1e-3
        )


UR10E = load_robot("ur10e")
UR_NOISE = np.array([1.0, 1.0, 0.7, 0.2, 0.2, 0.2])
UR_LOW, UR_HIGH = np.array([[-1.0, -2.0, 0.0, -2.0, -1.0, -1.0], [1.0, -0.4, 2.0, 0.4, 1.8, 1.6]])


@pytest.mark.parametrize("kg", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("spoilt", ["not", "zeros", "gain", "tilt"])
def test_zeros_a_gain_and_a_tilt_are_no_load(kg: float, spoilt: str, rng: np.random.Generator) -> None:
    q = rng.uniform(UR_LOW, UR_HIGH, (20, 6))
    arm = UR10E.with_payload("tool0", kg, [0.05, 0.0, 0.08]) if kg else UR10E
    down = UPRIGHT if spoilt != "tilt" else 9.81 * np.array([np.sin(0.05), 0.0, -np.cos(0.05)])
    tau = gravity_torque(arm, q, down) * (1.06 if spoilt == "gain" else 1.0) + rng.normal(0.0, UR_NOISE, q.shape)
    tau += np.array([0.0, 5.0, 4.0, 1.5, 0.0, 0.0]) * (spoilt == "zeros")
    found = locate_load(UR10E, q, tau, UPRIGHT, noise=UR_NOISE)
    if not kg:
        assert found.no_load > 0.8
        assert str(found).startswith("no load")
        return
    first = found.carriers[0]
    assert (first.frame, found.likely) == ("wrist_3_link", ("wrist_3_link",))
    assert abs(first.mass - kg) < 2.5 * first.mass_std
    assert first.mass_std < 0.3


def test_mass_and_its_deviation_are_told_of_the_likeliest_link(rng: np.random.Generator) -> None:
    q = poses(rng)
    found = locate_load(PLANAR, q, torques(q, rng), UPRIGHT, noise=NOISE).carriers[0]
    assert found.frame == "link3"
    assert found.mass == pytest.approx(0.8, abs=4.0 * found.mass_std)
    assert 0.0 < found.mass_std < 0.2


def test_an_unloaded_arm_is_called_so(rng: np.random.Generator) -> None:
    q = poses(rng)
    tau = gravity_torque(PLANAR, q, UPRIGHT) + NOISE * rng.normal(size=q.shape)
    assert locate_load(PLANAR, q, tau, UPRIGHT, noise=NOISE).no_load > 0.7


def test_a_single_pose_is_weighed_without_a_warning(rng: np.random.Generator) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert locate_load(ARM, np.zeros(2), held(np.zeros(2), rng), UPRIGHT, noise=NOISE).carriers


def test_wrong_arguments_are_refused() -> None:
    q = np.zeros((2, 3))
    with pytest.raises(InputError, match="tau: expected shape"):
        locate_load(PLANAR, q, np.zeros((3, 3)), UPRIGHT, noise=NOISE)
    with pytest.raises(InputError, match="noise"):
        locate_load(PLANAR, q, q, UPRIGHT, noise=0.0)
    with pytest.raises(InputError, match='"base" is on no link that moves'):
        locate_load(PLANAR, q, q, UPRIGHT, noise=NOISE, frames=("base",))
    with pytest.raises(InputError, match="claw"):
        locate_load(PLANAR, q, q, UPRIGHT, noise=NOISE, frames=("claw",))
