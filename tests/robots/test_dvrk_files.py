"""The dVRK's kinematics, instruments and arms in JSON: files made here in their shape, and its own where they lie."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import CatenaryError, FileFormatError, UnsupportedModelError
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from oracles.dh_products import PRODUCTS

HALF = 1.5708  # as the dVRK writes a quarter turn
TIP = [[0.0, -1.0, 0.0, 0.002], [0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.01], [0.0, 0.0, 0.0, 1.0]]


def row(name: str, kind: str, alpha: float, a: float, d: float, offset: float, **more: object) -> dict:
    fixed = {"alpha": alpha, "A": a, "theta": 0.0, "D": d, "type": kind, "mode": "active", "offset": offset}
    return {"name": name, **fixed, "qmin": -1.5, "qmax": 1.25, "ftmax": 3.5, **more}


ARM = [
    row("yaw", "revolute", HALF, 0.0, 0.0, HALF),
    row("pitch", "revolute", -HALF, 0.0, 0.0, -HALF),
    row("insertion", "prismatic", HALF, 0.0, 0.0, -0.4318, qmin=0.0, qmax=0.24),
]


def instrument(shaft: float) -> list[dict]:
    return [
        row("roll", "revolute", 0.0, 0.0, shaft, 0.0),
        row("wrist_pitch", "revolute", -HALF, 0.0, 0.0, -HALF),
        row("wrist_yaw", "revolute", -HALF, 0.0091, 0.0, -HALF),
    ]


def kinematics(joints: list[dict], convention: str | None = "modified", key: str = "joints", **more: object) -> dict:
    stated = {} if convention is None else {"convention": convention}
    return {"DH": {**stated, key: joints}, **more}


SHARE = {
    "kinematic/PSM.json": kinematics(ARM),
    "kinematic/ECM.json": kinematics([*ARM, row("roll", "revolute", 0.0, 0.0, 0.3829, 0.0)], key="links"),
    "kinematic/MTM.json": kinematics(
        [row(f"j{i}", "revolute", (-1) ** i * HALF, 0.1 * i, 0.05 * i, 0.3 * i) for i in range(7)],
        "standard",
        "links",
        coupling={"ActuatorToJointPosition": np.eye(7).tolist()},
    ),
    "kinematic/PSM_physical.json": kinematics([*ARM[:2], {**ARM[2], "mode": "passive"}]),
    "tool/LND_400006.json": kinematics(instrument(0.4162), tooltip_offset=TIP, jaw={"qmin": 0.0}),
    "tool/LND_420006.json": kinematics(instrument(0.4670), tooltip_offset=TIP),
    "tool/SNAKE_400117.json": kinematics(instrument(0.4), tooltip_offset=TIP, **{"snake-like": True}),
    "arm/PSM1.json": {"kinematic": "kinematic/PSM.json", "tool": "LND:420006[1]", "tool_detection": "FIXED"},
    "old.json": kinematics(  # of 2018: one file, a convention in each row, no names
        [
            {k: v for k, v in {**j, "convention": "modified"}.items() if k != "name"}
            for j in [*ARM, *instrument(0.4162)]
        ],
        None,
        "links",
        **{"base-offset": np.eye(4).tolist(), "tooltip-offset": TIP},
    ),
    "mounted.json": kinematics(
        ARM, base_offset=[[0.7071, -0.7071, 0, 0.2], [0.7071, 0.7071, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]]
    ),
    "io/pid.json": {"controllers": [1, 2, 3]},
    "mixed.json": kinematics([ARM[0], {**ARM[1], "convention": "standard"}]),
}


@pytest.fixture(scope="module")
def share(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder like the dVRK's share, with comments as its files have them."""
    folder = tmp_path_factory.mktemp("share")
    for name, content in SHARE.items():
        (folder / name).parent.mkdir(exist_ok=True)
        text = json.dumps(content, indent=2).replace("\n", ' // see the user\'s guide, -260 "degrees"\n', 3)
        (folder / name).write_text(f"/* -*- Mode: Javascript; a // in it -*- */\n{text}")
    for model in ("400006", "420006"):
        text = f'description = "kinematic/PSM.json"\ninstrument = "tool/LND_{model}.json"\nname = "psm"\n'
        (folder / f"psm_{model}.toml").write_text(text)
    return folder


def product(joints: list[dict], q: np.ndarray, convention: str, tip: list[list[float]] | None) -> np.ndarray:
    """T_base_tip, row by row."""
    T = np.eye(4)
    for joint, angle in zip(joints, q, strict=True):
        turns = joint["type"] == "revolute"
        theta = joint["theta"] + (angle + joint["offset"] if turns else 0.0)
        d = joint["D"] + (0.0 if turns else angle + joint["offset"])
        T = T @ PRODUCTS[convention](joint["alpha"], joint["A"], d, theta)
    return T if tip is None else T @ np.array(tip)


FILES = {
    "kinematic/PSM.json": (ARM, "modified", None),
    "kinematic/ECM.json": (SHARE["kinematic/ECM.json"]["DH"]["links"], "modified", None),
    "kinematic/MTM.json": (SHARE["kinematic/MTM.json"]["DH"]["links"], "standard", None),
    "old.json": ([*ARM, *instrument(0.4162)], "modified", TIP),
    "psm_400006.toml": ([*ARM, *instrument(0.4162)], "modified", TIP),
    "psm_420006.toml": ([*ARM, *instrument(0.4670)], "modified", TIP),
}


def matrix(model: RobotModel, q: np.ndarray) -> np.ndarray:
    pose = forward_kinematics(model, q)
    return np.vstack([np.column_stack([pose.rotation, pose.position]), [0, 0, 0, 1]])


@pytest.mark.parametrize("name", FILES)
def test_poses_are_the_products_of_the_files_rows(share: Path, name: str) -> None:
    joints, convention, tip = FILES[name]
    model = load_robot(share / name)
    assert model.joint_units == tuple("m" if joint["type"] == "prismatic" else "rad" for joint in joints)
    rng = np.random.default_rng(4)
    for _ in range(5):
        q = rng.uniform(-1.0, 1.0, len(joints))
        assert_allclose(matrix(model, q), product(joints, q, convention, tip), atol=1e-12)


def test_names_limits_and_strengths_are_the_files(share: Path) -> None:
    model = load_robot(share / "psm_420006.toml")
    assert model.name == "psm"
    assert model.joint_names == ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
    assert_allclose(model.upper, [1.25, 1.25, 0.24, 1.25, 1.25, 1.25])
    assert_allclose(model.lower[:3], [-1.5, -1.5, 0.0])
    assert_allclose(model.effort_limit, 3.5)
    assert load_robot(share / "old.json").joint_names == ("J1", "J2", "J3", "J4", "J5", "J6")
    assert sum("sha256" in source for source in model.sources) == 3  # the arm's, the instrument's, the table's


def test_a_classic_instrument_on_a_classic_arm_is_the_robot_of_the_catalogue(share: Path) -> None:
    made, known = load_robot(share / "psm_400006.toml"), load_robot("dvrk_psm")
    q = np.array([0.3, -0.2, 0.12, 0.5, -0.4, 0.3])
    tip = np.linalg.inv(np.array(TIP))
    tip[:3, 3] = -np.array(TIP)[:3, :3].T @ np.array(TIP)[:3, 3]
    wrist = matrix(made, q) @ tip
    # quarter turns written as 1.5708 are 4e-6 rad off, at .45 m
    assert_allclose(wrist[:3, 3], forward_kinematics(known, q).position, atol=1e-5)


def test_an_s_instrument_on_a_classic_arm_reaches_two_inches_farther_along_its_shaft(share: Path) -> None:
    classic, longer = (load_robot(share / f"psm_{model}.toml") for model in ("400006", "420006"))
    q = np.array([0.3, -0.2, 0.12, 0.5, -0.4, 0.3])
    deeper = q + np.array([0, 0, 0.0508, 0, 0, 0])
    assert_allclose(matrix(longer, q), matrix(classic, deeper), atol=1e-12)


def test_a_base_of_four_digits_is_the_rotation_next_to_it(share: Path) -> None:
    q = np.array([0.3, -0.2, 0.12])
    turned, plain = matrix(load_robot(share / "mounted.json"), q), matrix(load_robot(share / "kinematic/PSM.json"), q)
    c = np.sqrt(0.5)
    base = np.array([[c, -c, 0, 0.2], [c, c, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert_allclose(turned, base @ plain, atol=1e-12)


REFUSED = {
    "tool/LND_400006.json": (FileFormatError, r"is an instrument of the dVRK.*instrument = \"LND_400006.json\""),
    "tool/SNAKE_400117.json": (UnsupportedModelError, "is snake-like or has passive joints"),
    "kinematic/PSM_physical.json": (UnsupportedModelError, "passive joints.*the one without _physical"),
    "arm/PSM1.json": (FileFormatError, "expected kinematics with DH .*got kinematic, tool, tool_detection"),
    "io/pid.json": (FileFormatError, "expected kinematics with DH .*got controllers"),
    "mixed.json": (FileFormatError, "convention: expected modified or standard, the same in all rows"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_arm_or_moves_by_rules_elsewhere_is_refused_with_a_way_on(share: Path, name: str) -> None:
    kind, words = REFUSED[name]
    with pytest.raises(kind, match=words):
        load_robot(share / name)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"DH": {"convention": "modified", "joints": []}}', "joints"),
        ('{"DH": {"convention": "modified", "joints": [{"type": "helical", "alpha": 0, "A": 0}]}}', "type"),
        ('{"DH": {"convention": "modified", "joints": [{"type": "revolute", "alpha": "x", "A": 0}]}}', "alpha"),
        ('{"DH": {"convention": "modified", "joints": [{"type": "revolute", "alpha": 1e300, "A": 1e300}]}}', ""),
        ('{"DH": /* without an end', "cannot be read as JSON"),
        ('{"DH": "without an end // }', "cannot be read as JSON"),
        ("[1, 2]", "expected a table"),
        ("/*" * 200_000, "cannot be read as JSON"),
        ('"\\' * 200_000, "cannot be read as JSON"),
    ],
)
def test_damaged_files_are_refused_at_once(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(CatenaryError, match=words):
        load_robot(tmp_path / "bad.json")
