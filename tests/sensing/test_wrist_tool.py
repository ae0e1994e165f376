import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.errors import ConfigError, ExcitationError, InputError
from catenary.sensing.wrist_tool import fit_wrist_tool, load_tool, save_tool, weigh_tool
from catenary.spatial import Pose

MASS, CENTER = 0.82, np.array([0.01, -0.02, 0.09])
BIASES = np.array([3.0, -5.0, 12.0]), np.array([0.2, 0.05, -0.3])
SENSED = f"""<mujoco><worldbody><body name="wrist"><joint type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<site name="sensor"/><body name="tool"><site name="ft"/><inertial mass="{MASS}" pos="{" ".join(map(str, CENTER))}"
diaginertia="1e-3 1e-3 1e-3"/></body></body></worldbody>
<sensor><force site="ft"/><torque site="ft"/></sensor></mujoco>"""


def poses(count, seed=0):
    """Return gravity as the sensor sees it in poses at rest."""
    return Rotation.random(count, rng=np.random.default_rng(seed)).inv().apply([0.0, 0.0, -9.81])


def readings(down, noise=0.0, seed=1):
    rng = np.random.default_rng(seed)
    force, torque = MASS * down + BIASES[0], np.cross(CENTER, MASS * down) + BIASES[1]
    return force + rng.normal(0.0, noise, down.shape), torque + rng.normal(0.0, 0.02 * noise, down.shape)


def test_mujocos_sensor_shows_the_tool_that_hangs_on_it():
    model = mujoco.MjModel.from_xml_string(SENSED)
    data, turns = mujoco.MjData(model), Rotation.random(12, rng=np.random.default_rng(3))
    force, torque = [], []
    for turn in turns:
        data.qpos[:] = np.roll(turn.as_quat(), 1)
        mujoco.mj_inverse(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)
        # MuJoCo reads what the parent exerts on the child: what holds the tool
        force.append(-data.sensordata[:3])
        torque.append(-data.sensordata[3:])
    down = turns.inv().apply([0.0, 0.0, -9.81])
    tool = fit_wrist_tool(np.array(force) + BIASES[0], np.array(torque) + BIASES[1], down)
    assert_allclose(tool.mass, MASS, rtol=1e-9)
    assert_allclose(tool.center, CENTER, atol=1e-9)
    assert_allclose([tool.force_bias, tool.torque_bias], BIASES, atol=1e-9)


def test_deviations_are_those_of_repeated_fits():
    down = poses(15)
    fits = [fit_wrist_tool(*readings(down, 0.3, seed), down) for seed in range(300)]
    for name, truth in (("mass", MASS), ("center", CENTER), ("force_bias", BIASES[0]), ("torque_bias", BIASES[1])):
        found = np.array([getattr(fit, name) for fit in fits])
        said = np.mean([getattr(fit, f"{name}_deviation") for fit in fits], axis=0)
        assert_allclose(found.mean(axis=0), truth, atol=4.0 * said.max() / np.sqrt(300))
        assert_allclose(found.std(axis=0), said, rtol=0.2)  # 300 fits tell a deviation to 4 %


@pytest.mark.parametrize(("of_force", "of_torque"), [(1e3, 1.0), (1.0, 1e3), (1e-3, 1.0), (1e3, 1e3)])
def test_readings_in_other_units_are_refused(of_force, of_torque):
    down = poses(12)
    force, torque = readings(down, 0.1)
    with pytest.raises(InputError, match=r"forces are in N \(not mN or kN\), torques in Nm"):
        fit_wrist_tool(of_force * force, of_torque * torque, down)


def test_what_acts_on_the_tool_is_what_the_readings_hold_beyond_it():
    down = poses(10)
    tool = fit_wrist_tool(*readings(down), down)
    force, torque = readings(down)
    pushed, turned = tool.without(force + np.array([1.0, 2.0, 3.0]), torque + np.array([0.1, 0.0, 0.0]), down)
    assert_allclose(pushed, np.tile([1.0, 2.0, 3.0], (10, 1)), atol=1e-9)
    assert_allclose(turned, np.tile([0.1, 0.0, 0.0], (10, 1)), atol=1e-9)


def test_poses_that_do_not_show_a_tool_are_refused():
    down = poses(8)
    flat = Rotation.from_euler("z", np.linspace(0, 3, 8)[:, None]).inv().apply([6.9, 0.0, -6.9])
    with pytest.raises(
        ExcitationError, match=r"along \(.*1.00\) in the sensor's axes gravity differs by .* turn the wrist"
    ):
        fit_wrist_tool(*readings(flat), flat)
    with pytest.raises(InputError, match="3 poses, expected 4 or more"):
        fit_wrist_tool(*readings(down[:3]), down[:3])
    force, torque = readings(down)
    with pytest.raises(InputError, match=r"mass -0\.82 kg: the sensor counts forces the other way"):
        fit_wrist_tool(-force, -torque, down)


LEVEL = np.array([0.0, 0.0, -9.81])
AS_FRAMED, PLACE = np.eye(3), np.array([0.4, 0.0, 0.5])
MIRRORED = np.diag([1.0, 1.0, -1.0])
TURNED = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()


def weighed(axes=AS_FRAMED, *, of_torque=None, count=12, gravity=LEVEL, seed=5, pull=None, noise=0.02):
    """Weigh a tool in random poses by a sensor that reads `axes` times what acts, and what pulls at it in base axes."""
    rng = np.random.default_rng(seed)
    turns, places = Rotation.random(count, rng=rng), PLACE + rng.uniform(-0.4, 0.4, (count, 3))
    down = turns.inv().apply(gravity)
    force, torque = MASS * down, np.cross(CENTER, MASS * down)
    if pull is not None:
        force = force + turns.inv().apply(pull(places))
    force, torque = force @ axes.T, torque @ (axes if of_torque is None else of_torque).T
    force = force + BIASES[0] + rng.normal(0.0, noise, force.shape)
    torque = torque + BIASES[1] + rng.normal(0.0, 0.02 * noise, torque.shape)
    return weigh_tool(force, torque, Pose(turns.as_matrix(), places), LEVEL)


@pytest.mark.parametrize("count", [6, 12, 40])
@pytest.mark.parametrize(
    ("tilt", "axes", "name"),
    [
        (0.0, np.eye(3), None),
        (10.0, np.eye(3), "gravity"),
        (10.0, -np.eye(3), "gravity"),
        (0.0, np.diag([1.0, 0.5, 1.0]), "units"),
    ],
)
def test_a_tilted_base_or_gains_of_the_sensor_are_doubts(count, tilt, axes, name):
    true = Rotation.from_euler("x", tilt, degrees=True).apply(LEVEL)
    _, named = weighed(axes, count=count, gravity=true)
    assert [each.name for each in named] == ([] if name is None else [name])
    if name == "gravity":
        x, y, z = (float(v) for v in named[0].remedy.removeprefix("--gravity ").split(","))
        assert_allclose([x, y, z], true, atol=0.1)


@pytest.mark.parametrize("axes", [np.eye(3), -np.eye(3), TURNED, np.diag([-1.0, -1.0, 1.0]), np.eye(3)[[1, 2, 0]]])
@pytest.mark.parametrize("count", [6, 12])
def test_a_sensors_sign_and_axes_are_found_and_the_tool_with_them(axes, count):
    tool, doubts = weighed(axes, count=count)
    assert doubts == []
    assert_allclose(tool.mass, MASS, rtol=0.01)
    assert_allclose([tool.force_bias, tool.torque_bias], BIASES, atol=0.05)
    assert_allclose(tool.sign * tool.rotation.T, axes, atol=0.01)
    assert_allclose(tool.rotation @ tool.center, CENTER, atol=2e-3)


@pytest.mark.parametrize("axes", [MIRRORED, MIRRORED @ TURNED, -TURNED, np.eye(3)[[1, 0, 2]]])
def test_a_left_handed_sensor_is_refused(axes):
    with pytest.raises(InputError, match="which is left-handed"):
        weighed(axes)


def test_torques_in_other_axes_than_forces_are_a_doubt():
    _, (doubt,) = weighed(of_torque=np.diag([1.0, -1.0, 1.0]))
    assert "torques follow gravity" in doubt.says


def test_a_cable_that_drags_is_told(rng):
    """Springs to a point above, of 3 N and more, in the seeds that no threshold was chosen by."""
    for seed in range(1, 41, 2):
        anchor = np.random.default_rng(seed).uniform([-0.3, -0.3, 0.8], [0.3, 0.3, 1.3])
        _, doubts = weighed(seed=seed, pull=lambda places, to=anchor: 5.0 * (to - places))
        assert [each.name for each in doubts][-1] in ("cable", "gravity"), seed
        assert weighed(seed=seed)[1] == []


def test_a_tool_file_gives_the_same_tool(tmp_path):
    tool, _ = weighed(-np.eye(3))
    save_tool(tmp_path / "tool.toml", tool)
    read = load_tool(tmp_path / "tool.toml")
    for name, value in vars(tool).items():
        assert_allclose(getattr(read, name), value) if not isinstance(value, str) else None
    (tmp_path / "tool.toml").write_text((tmp_path / "tool.toml").read_text().replace("sign = -1.0", "sign = 2.0"))
    with pytest.raises(ConfigError, match=r"tool.toml: .*expected 1 or -1"):
        load_tool(tmp_path / "tool.toml")
