from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import simulated_arm
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.sensing.mounting import Mounting, save_mounting
from command_line import catenary, refusal

pytestmark = pytest.mark.usefixtures("hurried", "undrawn")

DOWN = np.array([0.0, 0.0, -9.81])
POSE = ("raven2", "--q", "0,1.57,0.32")
ARM = load_robot("raven2")


TILTED = Rotation.from_euler("XY", [20.0, -50.0], degrees=True).inv().apply(DOWN)


@pytest.mark.parametrize(
    ("options", "gravity"),
    [
        ((), DOWN),
        (("--gravity", "1,-2,-3.5"), [1.0, -2.0, -3.5]),
        (("--imu-reading", "-1,2,3.5"), [1.0, -2.0, -3.5]),  # specific force, up at rest
        (("--base-tilt-deg", "20,-50"), TILTED),  # rolled about x, then pitched about the base's own y
    ],
)
def test_gravity_gives_torques_with_their_units(options: tuple[str, ...], gravity: np.ndarray) -> None:
    content = catenary("gravity", *POSE, *options, "--json").json
    assert_allclose(content["gravity"], gravity, atol=1e-14)
    assert_allclose(content["tau"], gravity_torque(ARM, [0.0, 1.57, 0.32], gravity), atol=1e-13)
    assert_allclose(content["level"], gravity_torque(ARM, [0.0, 1.57, 0.32], DOWN), atol=1e-13)
    assert content["unit"] == ["Nm", "Nm", "N"]


def test_a_sensor_on_a_base_link_that_is_turned_from_the_world_gives_what_holds_the_arm(tmp_path: Path) -> None:
    # 2 kg half a metre out on a joint about the world's x; the sensor is turned about two axes from a turned base_link
    arm, file = tmp_path / "arm.urdf", tmp_path / "m.toml"
    arm.write_text("""<robot name="arm"><link name="world"/><link name="base_link"/><link name="imu_link"/>
      <link name="rod"><inertial><origin xyz="0 0.5 0"/><mass value="2"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="stand" type="fixed"><parent link="world"/><child link="base_link"/><origin rpy="1.2 0 0"/></joint>
      <joint name="glue" type="fixed"><parent link="base_link"/><child link="imu_link"/>
        <origin xyz="0.1 0 0" rpy="0 0.4 0"/></joint>
      <joint name="turn" type="revolute"><parent link="world"/><child link="rod"/><axis xyz="1 0 0"/>
        <limit lower="-3" upper="3" effort="99" velocity="9"/></joint></robot>""")
    on_base, bias = Rotation.from_rotvec([0.0, 0.4, 0.0]), np.array([0.1, -0.2, 0.3])
    save_mounting(file, Mounting(rotation=on_base.as_matrix(), base="base_link", bias=bias))
    up = (Rotation.from_rotvec([1.2, 0.0, 0.0]) * on_base).inv().apply(-DOWN)
    line = ("gravity", arm, "--q", "0", "--imu-reading")
    for reading, place in ((up, ("--imu-frame", "imu_link")), (up + bias, ("--mounting", file))):
        content = catenary(*line, ",".join(map(str, reading)), *place, "--json").json
        assert_allclose(content["gravity"], DOWN, atol=1e-9)
        assert_allclose(content["tau"], [2.0 * 9.81 * 0.5], atol=1e-9)
    assert "it moves with rod" in refusal(*line, "0,0,9.81", "--imu-frame", "rod")
    assert "--mounting: goes with --imu-reading" in refusal("gravity", *POSE, "--mounting", file)
    assert "does not go with" in refusal("gravity", *POSE, "--imu-reading", "0,0,9.8", "--gravity", "0,0,-9.8")


def test_gravity_is_written_as_formulas_of_the_joints() -> None:
    # two rods of 1 kg, 1 and 0.5 m long: 9.81 (0.5 + 1) and 9.81 0.25
    lines = catenary("gravity", "two_link", "--latex").out.splitlines()
    assert lines == ["g_{1} = 14.715 c_{1} + 2.4525 c_{12}", "g_{2} = 2.4525 c_{12}"]


def test_table_shows_the_difference_to_a_level_base() -> None:
    out = catenary("gravity", *POSE, "--base-tilt-deg", "0,20").out
    shoulder = next(line for line in out.splitlines() if "shoulder" in line).split()
    assert shoulder[-1] == "Nm"
    assert float(shoulder[3]) == pytest.approx(float(shoulder[1]) - float(shoulder[2]), abs=2e-4)


def test_track_tells_error_and_pd_share_and_writes_a_page(tmp_path: Path) -> None:
    page = tmp_path / "track.html"
    line = ("track", "raven2", "--motion", "random", "--seconds", "2", "--controller")
    content = catenary(*line, "dg", "--seed", "3", "--report", page, "--json").json
    assert content["simulated"]
    assert content["controller"] == "dg"
    assert [joint["name"] for joint in content["joints"]] == list(ARM.joint_names)
    for joint in content["joints"]:
        assert 0.0 < joint["rms_error"] < 1.0  # deg, mm
        assert joint["pd_share_percent"] > 0.0
    text = page.read_text()
    assert "Tracking with controller dg" in text
    assert "Simulated: no real robot" in text
    assert "100.0 %" in catenary(*line, "pd").out


def test_any_other_robot_is_held_as_rigid_bodies(tmp_path: Path) -> None:
    page = tmp_path / "hold.html"
    line = ("hold", "two_link", "--q-deg", "30,40", "--seconds", "0.2", "--base-tilt-deg", "0,90")
    assert str(page) in catenary(*line, "--report", page).out
    assert "Distance of every joint from its start" in page.read_text()
    assert "The arm where it was put, and, paler, at the end" in page.read_text()
    assert "0, 90" in page.read_text()  # the base's tilt
    assert max(joint["drift"] for joint in catenary(*line, "--json").json["joints"]) < 1e-3


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (("gravity", *POSE, "--gravity", "0,0,9.81"), "points up in base axes"),
        (("gravity", *POSE, "--gravity", "0,0,-981"), "magnitude of 981 m/s2"),
        (("gravity", *POSE), "shoulder: 0 rad is on a limit, 0 to 1.5708 rad"),
        (("gravity", "raven2", "--q", "0.1,0.1,0.3"), "elbow: 0.1 rad is outside its limits"),
    ],
)
def test_numbers_that_are_hardly_meant_are_noted_unless_notes_are_left_out(typed: tuple[str, ...], said: str) -> None:
    assert said in catenary(*typed).err
    quiet = catenary(*typed, "--no-notes")
    assert quiet.err == ""
    assert quiet.out == catenary(*typed).out


def test_what_is_doubtful_about_a_file_is_a_note_or_an_error(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    impossible = simulated_arm.DH_TABLE.replace(
        "inertia_kg_m2 = [0.01, 0, 0, 0.01, 0, 0.01]", "inertia_kg_m2 = [-1, 0, 0, 1, 0, 1]", 1
    )
    assert impossible != simulated_arm.DH_TABLE
    path.write_text(impossible)
    asked = ("gravity", path, "--q", "0,0.1", "--gravity", "0,-9.81,0")
    shown = catenary(*asked, "--json")
    assert shown.err.startswith("note: ")
    assert "negative principal moment" in shown.err
    assert_allclose(shown.json["tau"], [0.2 * 9.81, 0.0], rtol=1e-12)
    assert "negative principal moment" in refusal(*asked, "--strict")


def test_links_are_declared_massless_by_name_or_all_at_once(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(simulated_arm.URDF_WITHOUT_INERTIA)
    assert '"upper", "fore"' in refusal("gravity", path, "--q", "0,0.1")
    for links in ("upper,fore", "all"):
        shown = catenary("gravity", path, "--q", "0,0.1", "--massless", links, "--json")
        assert shown.json["tau"] == [0.0, 0.0]
    assert 'massless link "nose" is not a link' in refusal("gravity", path, "--q", "0,0.1", "--massless", "nose")


HELD = ("hold", "two_link", "--q-deg", "30,40", "--seconds", "0.3", "--json")


def test_an_arm_on_a_deck_that_heaves_is_held_by_a_simulated_sensor() -> None:
    deck = ("--rock", "x,8,0.1", "--rock", "y,4,0.14,40", "--heave", "2,0.12", "--surge", "1,0.1,90", "--sway", "1,0.2")
    sensor = ("--mounting-on", "ship", "--sensor-bias", "0.02,0.02,-0.01", "--sensor-noise", "0.03")
    content = catenary(*HELD, *deck, *sensor).json
    assert set(content["gravity_ticks"]) == {"live"}
    assert content["faults"] == {}
    assert content["mounting_on"] == "ship"
    assert content["rock"] == ["x,8,0.1", "y,4,0.14,40"]
    assert max(joint["drift"] for joint in content["joints"]) < 1.0  # deg


def test_an_arm_has_the_friction_and_gains_that_it_is_given() -> None:
    level = ("--base-tilt-deg", "30,30", "--controller", "sg")
    free, stuck = (catenary(*HELD, *level, *more).json for more in ((), ("--friction", "50", "--kp", "100,50")))
    assert max(joint["drift"] for joint in free["joints"]) > 1.0
    assert max(joint["drift"] for joint in stuck["joints"]) < 1e-6
    assert stuck["kp"] == [100.0, 50.0]
    assert "gravity_ticks" not in stuck


LOAD = ("--payload", "2", "--payload-on", "tool0", "--payload-at", "0,0,0.1")


def test_every_command_that_takes_a_payload_computes_with_it(tmp_path: Path) -> None:
    heavy, light = (tmp_path / name for name in ("heavy.h", "light.h"))
    assert catenary("export", "ur10e", "--c", heavy, *LOAD).code == 0
    assert catenary("export", "ur10e", "--c", light).code == 0
    assert heavy.read_text() != light.read_text()
    assert "--payload, --friction, --viscous and --tool are for a robot" in refusal(
        "export", "--model", "model.npz", "--c", tmp_path / "x.h", *LOAD
    )
    assert catenary("plot", "ur10e", "--out", tmp_path / "arm.png", *LOAD).code == 0


@pytest.mark.slow  # designs two motions
def test_a_designed_motion_asks_more_of_an_arm_that_carries(tmp_path: Path) -> None:
    plan = ("excitation", "ur10e", "--no-collision-check", "--trials", "1", "--rate-hz", "30", "--json")
    light, heavy = (
        catenary(*plan, "--out", tmp_path / f"{k}.npz", *load).json["torque_share"] for k, load in enumerate(((), LOAD))
    )
    assert light != heavy
