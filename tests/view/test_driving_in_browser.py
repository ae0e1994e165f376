"""Every control of a simulated arm's page, worked in a real browser: what it does is read from the page itself."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from catenary.sensing.vector import tilted_gravity
from view.browser import LookedAtPage, looked_at
from view.command import model_of_positions, view

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

LEVEL_BASE, SENSED = "PD + gravity of a level base (SG)", "PD + sensed gravity (DG)"


@pytest.fixture(scope="module")
def looked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LookedAtPage]:
    """The page of a RAVEN-II with a model, at rest; one for all tests, each of which leaves it as it was."""
    model = model_of_positions(tmp_path_factory.mktemp("model") / "arm.npz")
    with view("raven2", "--model", model) as url, looked_at(url) as looked:
        looked.choose("controller", SENSED)
        rest(looked)
        yield looked
        assert looked.complaints == []
        assert looked.foreign == []


def rest(looked: LookedAtPage) -> None:
    looked.tab("Drive")
    looked.choose("motion", "rest")
    looked.wait_for_text("ENABLED, homed: rest")


def positions(looked: LookedAtPage, column: int = 0) -> np.ndarray:
    return np.array([looked.joint(name, column) for name in ("shoulder", "elbow", "insertion")])


def stands(looked: LookedAtPage) -> bool:
    """Tell whether neither the reported nor the true arm has moved since the page's last three looks."""
    seen = []
    for _ in range(3):
        seen.append(np.concatenate([positions(looked, 0), positions(looked, 2)]))
        looked.page.wait_for_timeout(700)
    return bool(np.ptp(seen, axis=0).max() < 0.05)


def reported_less_true(looked: LookedAtPage) -> np.ndarray:
    looked.wait_until(lambda: stands(looked))
    return positions(looked, 0) - positions(looked, 2)


def stands_near(looked: LookedAtPage, name: str, goal: float) -> bool:
    return abs(looked.joint(name) - goal) < 8.0 and stands(looked)


def gravity(looked: LookedAtPage) -> np.ndarray:
    found = re.search(r"gravity measured: (\S+), (\S+), (\S+) m/s", looked.words())
    assert found is not None
    return np.array([float(text.replace("−", "-")) for text in found.groups()])


def test_zigzags_and_random_motion_move_the_arm_and_rest_stops_it(looked: LookedAtPage) -> None:
    for motion in ("zig-zag", "random motion"):
        looked.tab("Drive")
        looked.choose("motion", motion)
        looked.wait_for_text(f"ENABLED, homed: {motion}")
        before = positions(looked)
        looked.wait_until(lambda before=before: np.abs(positions(looked) - before).max() > 1.0)
        rest(looked)
        looked.wait_until(lambda: stands(looked))


def test_run_levels_pause_enable_and_home(looked: LookedAtPage) -> None:
    looked.tab("Drive")
    looked.press("pause")
    looked.wait_for_text("PAUSED, homed")
    looked.press("enable")
    looked.wait_for_text("ENABLED, homed: rest")
    looked.press("home")
    looked.wait_for_text("homing")
    looked.wait_for_text("ENABLED, homed: rest")


def test_tilted_base_turns_sensed_gravity_and_only_one_controller_knows(looked: LookedAtPage) -> None:
    looked.tab("Surroundings")
    looked.set_slider("base roll [deg]", 30.0)
    looked.set_slider("base pitch [deg]", -20.0)
    expected = tilted_gravity(*np.deg2rad([30.0, -20.0]))
    looked.wait_until(lambda: np.abs(gravity(looked) - expected).max() < 0.3)
    looked.wait_until(lambda: apart(looked) < 1.0)
    looked.tab("Drive")
    looked.choose("controller", LEVEL_BASE)
    level = tilted_gravity(0.0, 0.0)
    angle = np.rad2deg(np.arccos(expected @ level / (level @ level)))
    looked.wait_until(lambda: abs(apart(looked) - angle) < 2.0)
    looked.choose("controller", SENSED)
    looked.tab("Surroundings")
    looked.set_slider("base roll [deg]", 0.0)
    looked.set_slider("base pitch [deg]", 0.0)
    looked.wait_until(lambda: np.abs(gravity(looked) - level).max() < 0.3)


def apart(looked: LookedAtPage) -> float:
    found = re.search(r"(\S+) deg apart", looked.words())
    return np.nan if found is None else float(found[1])


def test_rocking_base_rocks_gravity(looked: LookedAtPage) -> None:
    looked.tab("Surroundings")
    looked.set_slider("rocking, to either side [deg]", 20.0)
    seen: list[float] = []

    def swings() -> bool:
        seen.append(gravity(looked)[1])
        return max(seen) > 1.5 and min(seen) < -1.5

    looked.wait_until(swings, every=170)
    looked.set_slider("rocking, to either side [deg]", 0.0)
    looked.wait_until(lambda: spread(looked) < 0.1)


def test_broken_sensor_is_named_and_a_mended_one_no_longer(looked: LookedAtPage) -> None:
    looked.tab("Surroundings")
    for fault, said in (("unplugged", "no new gravity"), ("stuck", "repeats one reading")):
        looked.choose("gravity sensor's fault", fault)
        looked.wait_for_text(said)
        looked.choose("gravity sensor's fault", "none")
        looked.wait_until(lambda said=said: said not in looked.words())
    quiet = spread(looked)
    looked.choose("gravity sensor's fault", "noisy")
    looked.wait_until(lambda: spread(looked) > 3.0 * quiet)
    looked.choose("gravity sensor's fault", "none")


def spread(looked: LookedAtPage) -> float:
    seen = []
    for _ in range(8):
        looked.page.wait_for_timeout(260)
        seen.append(gravity(looked))
    return float(np.std(seen, axis=0).max())


@pytest.mark.parametrize(("label", "value", "usual"), [("payload [kg]", 1.0, 0.0), ("cable wear [share]", 1.0, 0.0)])
def test_payload_and_wear_part_the_reported_arm_from_the_true_one(
    looked: LookedAtPage, label: str, value: float, usual: float
) -> None:
    before = reported_less_true(looked)
    looked.tab("Surroundings")
    looked.set_slider(label, value)
    looked.wait_until(lambda: np.abs(reported_less_true(looked) - before).max() > 0.1)  # deg or mm
    looked.set_slider(label, usual)


def test_more_friction_leaves_an_arm_under_pd_farther_from_its_goal(looked: LookedAtPage) -> None:
    short = []
    for friction, goal in ((0.0, 50.0), (4.0, 30.0)):
        looked.tab("Surroundings")
        looked.set_slider("Coulomb friction, x its own", friction)
        looked.tab("Drive")
        looked.set_slider("shoulder [deg]", goal)
        looked.wait_until(lambda goal=goal: stands_near(looked, "shoulder", goal))
        short.append(abs(looked.joint("shoulder") - goal))
    assert short[1] > short[0]
    looked.tab("Surroundings")
    looked.set_slider("Coulomb friction, x its own", 1.0)
    rest(looked)


def test_switched_on_the_model_puts_the_calibrated_joint_where_the_slider_says(looked: LookedAtPage) -> None:
    goal = 60.0
    looked.set_slider("elbow [deg]", goal)
    looked.wait_until(lambda: stands_near(looked, "elbow", goal))
    assert abs(looked.joint("elbow", 0) - goal) < 0.7 < abs(looked.joint("elbow", 1) - goal)
    looked.tab("Model")
    looked.tick("the loop goes by the model")
    looked.wait_until(lambda: abs(looked.joint("elbow", 1) - goal) < 0.7 < abs(looked.joint("elbow", 0) - goal))
    looked.tick("the loop goes by the model")
    rest(looked)
