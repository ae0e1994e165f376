"""Labs: checks tell right answers from usual mistakes, and the notebooks run with gaps and without."""

import re
import sys

import numpy as np
import pytest

from notebooks import LABS, notebook_of
from test_notebooks import darkness, executed

sys.path.insert(0, str(LABS))
import checks

# right answers in closed form, not the package's
TORQUE = "[9.81 * (1.5 * np.cos(q[0]) + 0.25 * np.cos(q[0] + q[1])), 9.81 * 0.25 * np.cos(q[0] + q[1])]"
SAG = "-np.array(torque(q_ref)) / kp"
MATRIX = "[[9.81 * np.cos(q[0]), 9.81 * np.cos(q[0] + q[1])], [0.0, 9.81 * np.cos(q[0] + q[1])]]"
ESTIMATE = "np.linalg.lstsq(np.vstack([regressor(each) for each in q]), tau.ravel(), rcond=None)[0]"
PITCHED = "[9.81 * np.sin(pitch), 0.0, -9.81 * np.cos(pitch)]"
TILTED = (
    "[(1.5 * np.sin(q[0]) + 0.25 * np.sin(q[0] + q[1])) * gravity[0]"
    " - (1.5 * np.cos(q[0]) + 0.25 * np.cos(q[0] + q[1])) * gravity[2],"
    " 0.25 * (np.sin(q[0] + q[1]) * gravity[0] - np.cos(q[0] + q[1]) * gravity[2])]"
)
DIRECTION = "np.tanh(np.gradient(reported, time) / (0.02 * np.abs(np.gradient(reported, time)).max()))"
ANSWERS = {
    "1_gravity_and_pd": [("[..., ...]", TORQUE), ("[..., ...]", SAG)],
    "2_torques_tell_masses": [
        ("[..., ...]", "[1.0, 0.5]"),
        ("[[..., ...], [..., ...]]", MATRIX),
        ("[..., ...]", ESTIMATE),
        ("[..., ...]", "[np.pi / 2, 0.0]"),
    ],
    "3_a_base_that_tilts": [
        ("[..., ..., ...]", PITCHED),
        ("[..., ...]", TILTED),
        ("[..., ..., ...]", "-np.asarray(reading)"),
    ],
    "4_cables_between": [
        ("return ...", "return np.sqrt(np.mean(error**2))"),
        ("[..., ...]", "np.polyfit(reported, true, 1)"),
        ("..., ...", '"monday", "tuesday"'),
        ("return ...", f"return {DIRECTION}"),
    ],
}
# check, what the answer is a function of, right answer, mistakes and what is said of them
ASKED = {
    "torque": (
        checks.check_torque,
        "q",
        TORQUE,
        {
            TORQUE.replace("9.81", "-9.81"): "the sign",
            TORQUE.replace("9.81 *", ""): "g = 9.81 m/s2 is missing",
            TORQUE.replace("cos", "sin"): "the angles count from the horizontal",
            TORQUE.replace("q[0] + q[1]", "q[1]"): "q[1] counts from the first rod",
            TORQUE.replace("1.5", "2.0").replace("0.25", "0.5"): "masses sit half way",
            TORQUE.replace("1.5", "0.5"): "the first joint carries the whole second rod",
            re.sub(r"cos\(([^)]*)\)", r"cos(np.rad2deg(\1))", TORQUE): "angles are in rad",
            TORQUE.replace("0.25", "0.3"): "not right, and none of the usual mistakes: both joints",
            TORQUE.replace("1.5", "1.4"): "not right, and none of the usual mistakes: joint 0 alone",
            "[1.0]": "expected 2 numbers",
        },
    ),
    "sag": (
        checks.check_sag,
        "q_ref, kp",
        SAG,
        {SAG[1:]: "the sign", f"{SAG} * kp": "at rest kp (q_ref - q)", f"np.rad2deg({SAG})": "in rad"},
    ),
    "regressor": (
        checks.check_regressor,
        "q",
        MATRIX,
        {
            MATRIX.replace("9.81", "-9.81"): "the sign",
            MATRIX.replace("9.81 *", ""): "g = 9.81 m/s2 is missing",
            f"np.transpose({MATRIX})": "rows are joints",
            f"np.array({MATRIX}) * [1.5, 0.25]": "no mass belongs into the matrix",
            f"np.array({MATRIX}) * np.eye(2)": "the first joint carries the second rod",
            f"[({MATRIX})[0]] * 2": "the second joint does not feel the first rod",
            MATRIX.replace("q[0] + q[1]", "q[1]"): "q[1] counts from the first rod",
            MATRIX.replace("cos", "sin"): "the angles count from the horizontal",
        },
    ),
    "estimate": (
        checks.check_estimate,
        "q, tau",
        ESTIMATE,
        {
            f"9.81 * {ESTIMATE}": "in kg m, not Nm",
            f"{ESTIMATE} / 9.81": "divided by g twice",
            f"{ESTIMATE}[::-1]": "the first column belongs to s[0]",
            f"-{ESTIMATE}": "the sign",
            "np.linalg.solve(regressor(q[0]), tau[0])": "of one pose",
            "[1.83, 0.41]": "of one pose, or of none",
        },
    ),
    "gravity": (
        checks.check_base_gravity,
        "pitch",
        PITCHED,
        {
            PITCHED.replace("[9.81", "[-9.81"): "turned the other way",
            f"-np.array({PITCHED})": "this is what an accelerometer reads",
            "[0.0, -9.81 * np.sin(pitch), -9.81 * np.cos(pitch)]": "turned about x",
            f"({PITCHED})[::-1]": "on a level base it is",
            PITCHED.replace("9.81 *", "1.0 *"): "in m/s2",
            PITCHED.replace("(pitch)", "(np.rad2deg(pitch))"): "angles are in rad",
        },
    ),
    "tilted torque": (
        checks.check_tilted_torque,
        "q, gravity",
        TILTED,
        {
            f"-np.array({TILTED})": "the sign: motors",
            TORQUE.replace("9.81", "-gravity[2]"): "right on a level base only",
            TILTED.replace("gravity[0]", "-gravity[0]"): "the sign of gravity's x component",
            TILTED.replace("gravity[2]", "-gravity[2]"): "the vector points down",
            f"9.81 * np.array({TILTED}) / np.linalg.norm(gravity)": "gravity's own length counts",
            TILTED.replace("gravity[2]", "gravity[1]"): "not right, and none of the usual mistakes: both joints",
        },
    ),
    "felt": (
        checks.check_felt,
        "reading",
        "-reading",
        {
            "reading": "the sign",
            "-9.81 * reading / np.linalg.norm(reading)": "its length tells",
            "-reading + [0, 0, -9.81]": "gravity is in the reading already: nothing is to be added",
        },
    ),
    "rms": (
        checks.check_rms,
        "error",
        "np.sqrt(np.mean(error**2))",
        {
            "np.mean(error**2)": "the root is missing",
            "np.mean(np.abs(error))": "of squares",
            "error.std()": "a mean error is an error",
            "np.sqrt(np.sum(error**2))": "the mean of the squares",
            "error.mean()": "this is the mean",
            "np.rad2deg(np.sqrt(np.mean(error**2)))": "in rad",
        },
    ),
    "line": (
        checks.check_line,
        "reported, true",
        "np.polyfit(reported, true, 1)",
        {
            "np.polyfit(true, reported, 1)": "from reported to true",
            "np.polyfit(reported, true, 1)[::-1]": "slope first",
            "np.polyfit(reported, true - reported, 1)": "of the true position",
            "[1.0, np.mean(true - reported)]": "a line has a slope",
            "[reported @ true / (reported @ reported), 0.0]": "a line has an offset",
        },
    ),
    "direction": (
        checks.check_direction,
        "time, reported",
        "np.sign(np.gradient(reported, time))",
        {
            DIRECTION: "right",
            "np.gradient(reported, time)": "this is the velocity",
            "-np.sign(np.gradient(reported, time))": "the sign: +1",
            "np.sign(reported)": "this is the sign of the position",
            "np.sign(np.diff(reported))": "one value a row",
            "np.ones(len(time))": "not right",
        },
    ),
}
CASES = [
    (name, answer, said)
    for name, (_, _, right, mistakes) in ASKED.items()
    for answer, said in {right: "right", **mistakes}.items()
]


@pytest.mark.parametrize(("name", "answer", "said"), CASES)
def test_an_answer_is_right_or_its_mistake_is_told(name, answer, said):
    known = {"np": np}
    for helper, of, value in (("torque", "q", TORQUE), ("regressor", "q", MATRIX)):
        known[helper] = eval(f"lambda {of}: {value}", known)
    check, parameters, *_ = ASKED[name]
    assert check(eval(f"lambda {parameters}: {answer}", known)).startswith(said)


@pytest.mark.parametrize(
    ("convention", "a", "said"),
    [
        ("standard", [1.0, 0.5], "right"),
        ("modified", [0.0, 1.0], "right"),
        ("standard", [0.0, 1.0], "these are the lengths of the modified convention"),
        ("modified", [1.0, 0.5], "these are the lengths of the standard convention"),
        ("standard", [1000.0, 500.0], "in m, not mm"),
        ("standard", [0.5, 1.0], "the first row belongs to the first rod"),
        ("standard", [0.5, 0.25], "from joint to joint"),
        ("standard", [1.0, 0.4], "not right, and none of the usual mistakes: row 1 alone; at the table"),
        ("craig", [0.0, 1.0], "the convention"),
    ],
)
def test_a_table_of_the_other_convention_is_told_from_a_wrong_one(convention, a, said):
    assert checks.check_table(convention, a).startswith(said)


@pytest.mark.parametrize(
    ("q", "said"),
    [
        ([np.pi / 2, 0.0], "right"),
        ([-np.pi / 2, np.pi], "right"),
        ([90.0, 0.0], "angles are in rad"),
        ([0.0, np.pi / 2], "not silent: at q = [0.    1.571] the first rod"),
        ([np.pi / 2, np.pi / 2], "not silent: at q = [1.571 1.571] the second rod"),
    ],
)
def test_a_silent_pose_has_both_rods_upright(q, said):
    assert checks.check_silent_pose(q).startswith(said)


@pytest.mark.parametrize(
    ("trained", "tested", "said"),
    [
        ("monday", "tuesday", "right"),
        ("monday", "monday", "a model knows the rows"),
        ("monday", "monday, every other row", "every other row is a neighbour"),
        ("tuesday", "monday", "possible"),
        ("sunday", "tuesday", "expected one of"),
    ],
)
def test_a_model_is_tested_on_another_day(trained, tested, said):
    assert checks.check_test(trained, tested).startswith(said)


@pytest.mark.parametrize("filled", [False, True], ids=["gaps", "filled"])
@pytest.mark.parametrize("name", ANSWERS)
def test_a_notebook_runs_with_gaps_and_without_and_draws(tmp_path, name, filled):
    text = (LABS / f"{name}.py").read_text()
    for gap, answer in ANSWERS[name] if filled else ():
        assert gap in text
        text = text.replace(gap, answer, 1)
    outputs = [one for outputs in executed(notebook_of(text), tmp_path) for one in outputs]
    printed = "".join(one.text for one in outputs if one.output_type == "stream" and one.name == "stdout")
    said = re.findall(r"^(?:right|not filled in yet)$", printed, re.MULTILINE)
    assert said == ["right" if filled else "not filled in yet"] * len(ANSWERS[name])
    pictures = [one for one in outputs if "image/png" in one.get("data", {})]
    assert [darkness(one) > 0.01 for one in pictures] == [True]
    if filled and name[0] == "1":
        assert "with your torque: by [0. 0.] deg" in printed.replace("-0.", "0.")
    if filled and name[0] == "3":
        errors = np.array(re.findall(r"\[ ?(\S+) +(\S+?) ?\] deg", printed), dtype=float)
        alone, static, dynamic, yours = errors
        assert np.all(dynamic < yours)
        assert np.all(4.0 * yours < static)
        assert np.all(static < alone)
    if filled and name[0] == "4":
        raw, line, both, package = np.array(re.findall(r"^(?:reported|line|line and direction|catenary.fit) +(\S+) deg",
                                                       printed, re.MULTILINE), dtype=float)  # fmt: skip
        assert raw > 2.0 * line > 2.0 * both > 0.0
        assert package < line


def test_every_lab_has_answers_and_gaps_for_all_of_them():
    assert sorted(ANSWERS) == sorted(path.stem for path in LABS.glob("[0-9]*.py"))
