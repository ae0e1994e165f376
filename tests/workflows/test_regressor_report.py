import json
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from catenary.files import json_text
from catenary.gravity.torque import gravity_torque
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import identity_pose
from catenary.workflows.regressor_report import describe_regressor
from oracles.random_trees import random_inertia, random_pose


def arm_on_a_vertical_axis() -> RobotModel:
    rng = np.random.default_rng(0)
    links = [
        Link("turn", "base", "revolute", identity_pose(), variable={"a": 1.0}, inertia=random_inertia(rng)),
        Link("lift", "turn", "revolute", random_pose(rng), variable={"b": 1.0}, inertia=random_inertia(rng)),
    ]
    return assemble("crane", links, [Coordinate("a", "rad"), Coordinate("b", "rad")])


def test_tilting_tells_the_first_link_of_an_arm_on_a_vertical_axis() -> None:
    report = describe_regressor(arm_on_a_vertical_axis())
    assert (report.bases["level"].count, report.bases["tilted"].count) == (2, 4)
    added = report.added_by_tilting()
    assert [label.split(" ")[0] for label in added] == ["mx(turn)", "my(turn)"]
    assert f"tilting the base adds 2: {'; '.join(added)}" in report.sentences()


def test_sentences_name_every_parameter_once() -> None:
    text = "\n".join(describe_regressor(load_robot("raven2")).sentences())
    assert "identifiable by themselves: mx(shoulder), m(insertion)" in text
    assert "without effect on any torque: m(shoulder), mz(shoulder), m(elbow)" in text
    assert "tilting the base adds none" in text
    assert "massless, and so left out: roll" in describe_regressor(load_robot("raven2_full")).sentences()[-1]


def test_values_hold_the_arm() -> None:
    arm = load_robot("raven2")
    report = describe_regressor(arm)
    q, gravity = np.array([0.5, 1.2, 0.4]), np.array([0.0, 0.0, -9.81])
    held = gravity_torque(arm, q, gravity)
    values = report.base_values("level")
    level, rest = report.bases["level"], np.zeros((1, 3))
    assert_allclose(level.regressor(q[None], rest, rest, gravity)[0] @ values, held, atol=1e-9)
    assert_allclose(report.compact.Z(q, gravity) @ report.compact_values, held, atol=1e-12)


def test_a_robot_without_inertia_has_a_regressor_without_values() -> None:
    report = describe_regressor(replace(load_robot("raven2"), missing_inertia=("elbow",)))
    content = json.loads(json_text(report.as_data()))
    assert content["base"]["level"]["rank"] == 5
    assert {entry["value"] for entry in content["standard"]} == {None}
    assert {entry["value"] for entry in content["compact"]["parameters"]} == {None}
    assert content["compact"]["symbols"]["m1"]["value"] is None
    assert report.sentences()[-1] == "no inertia in the file, so no values: elbow"
