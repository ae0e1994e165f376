"""Labs: checks tell right answers from usual mistakes, and the notebooks run with gaps and without."""

import re
import sys
from itertools import chain, cycle

import numpy as np
import pytest

from notebooks import LABS, notebook_of
from test_notebooks import darkness, executed

sys.path.insert(0, str(LABS))
import checks

# right answers in closed form, not the package's
TORQUE = "[9.81 * (1.5 * np.cos(q[0]) + 0.25 * np.cos(q[0] + q[1])), 9.81 * 0.25 * np.cos(q[0] + q[1])]"
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
    "1_gravity_and_pd": [("[..., ...]", TORQUE), ("[..., ...]", "-np.array(torque(q_ref)) / kp")],
    "2_torques_tell_masses": [
        ("[..., ...]", "[1.0, 0.5]"), ("[[..., ...], [..., ...]]", MATRIX),
        ("[..., ...]", ESTIMATE), ("[..., ...]", "[np.pi / 2, 0.0]"),
    ],
    "3_a_base_that_tilts": [
        ("[..., ..., ...]", PITCHED), ("[..., ...]", TILTED), ("[..., ..., ...]", "-np.asarray(reading)"),
    ],
    "4_cables_between": [
        ("return ...", "return np.sqrt(np.mean(error**2))"), ("[..., ...]", "np.polyfit(reported, true, 1)"),
        ("..., ...", '"monday", "tuesday"'), ("return ...", f"return {DIRECTION}"),
    ],
}  # fmt: skip
# of mistakes whose answers `checks` computes otherwise than a student: the check, its answer, and what is said of it
MISTAKES = [
    ("torque", TORQUE.replace("cos", "sin"), "the angles count from the horizontal"),
    ("torque", TORQUE.replace("q[0] + q[1]", "q[1]"), "q[1] counts from the first rod"),
    ("torque", TORQUE.replace("1.5", "2.0").replace("0.25", "0.5"), "masses sit half way"),
    ("torque", TORQUE.replace("1.5", "0.5"), "the first joint carries the whole second rod"),
    ("torque", re.sub(r"cos\(([^)]*)\)", r"cos(np.rad2deg(\1))", TORQUE), "angles are in rad"),
    ("torque", TORQUE.replace("0.25", "0.3"), "not right, and none of the usual mistakes: both joints"),
    ("torque", TORQUE.replace("1.5", "1.4"), "not right, and none of the usual mistakes: joint 0 alone"),
    ("torque", "[1.0]", "expected 2 numbers"),
    ("regressor", f"np.array({MATRIX}) * [1.5, 0.25]", "no mass belongs into the matrix"),
    ("regressor", f"[({MATRIX})[0]] * 2", "the second joint does not feel the first rod"),
    ("regressor", MATRIX.replace("q[0] + q[1]", "q[1]"), "q[1] counts from the first rod"),
    ("regressor", MATRIX.replace("cos", "sin"), "the angles count from the horizontal"),
    ("estimate", "np.linalg.solve(regressor(q[0]), tau[0])", "of one pose"),
    ("estimate", "[1.83, 0.41]", "of one pose, or of none"),
    ("base_gravity", PITCHED.replace("(pitch)", "(np.rad2deg(pitch))"), "angles are in rad"),
    ("tilted_torque", TORQUE.replace("9.81", "-gravity[2]"), "right on a level base only"),
    ("tilted_torque", TILTED.replace("gravity[0]", "-gravity[0]"), "the sign of gravity's x component"),
    ("tilted_torque", f"9.81 * np.array({TILTED}) / np.linalg.norm(gravity)", "gravity's own length counts"),
    ("direction", "np.sign(np.gradient(reported, time))", "right"),
    ("direction", "np.gradient(reported, time)", "this is the velocity"),
    ("direction", "-np.sign(np.gradient(reported, time))", "the sign: +1"),
    ("direction", "np.sign(reported)", "this is the sign of the position"),
    ("direction", "np.sign(np.diff(reported))", "one value a row"),
    ("direction", "np.ones(len(time))", "not right"),
]
PARAMETERS = {"torque": "q", "regressor": "q", "estimate": "q, tau", "base_gravity": "pitch",
              "tilted_torque": "q, gravity", "direction": "time, reported"}  # fmt: skip


@pytest.mark.parametrize(("name", "answer", "said"), MISTAKES)
def test_a_students_mistake_is_told(name, answer, said):
    known = {"np": np}
    known["regressor"] = eval(f"lambda q: {MATRIX}", known)
    answered = eval(f"lambda {PARAMETERS[name]}: {answer}", known)
    assert getattr(checks, f"check_{name}")(answered).startswith(said)


@pytest.mark.parametrize(
    ("said", "name", "given"),
    [
        ("right", "table", ("modified", [0.0, 1.0])),
        ("the convention", "table", ("craig", [0.0, 1.0])),
        ("not right, and none of the usual mistakes: row 1 alone; at the table", "table", ("standard", [1.0, 0.4])),
        ("right", "silent_pose", ([-np.pi / 2, np.pi],)),
        ("angles are in rad", "silent_pose", ([90.0, 0.0],)),
        ("not silent: at q = [0.    1.571] the first rod", "silent_pose", ([0.0, np.pi / 2],)),
        ("not silent: at q = [1.571 1.571] the second rod", "silent_pose", ([np.pi / 2, np.pi / 2],)),
        ("a model knows the rows", "test", ("monday", "monday")),
        ("every other row is a neighbour", "test", ("monday", "monday, every other row")),
        ("possible", "test", ("tuesday", "monday")),
        ("expected one of", "test", ("sunday", "tuesday")),
    ],
)
def test_an_answer_that_is_no_formula_is_judged(said, name, given):
    assert getattr(checks, f"check_{name}")(*given).startswith(said)


@pytest.mark.parametrize(
    "name",
    [name for name, one in vars(checks).items() if name.startswith("check_") and "usual" in one.__code__.co_varnames],
)
def test_each_usual_answer_is_told_from_all_others(name, monkeypatch):
    check, usual = getattr(checks, name), {}

    def answers(values):
        in_turn = chain(values[:1], cycle(values))  # the first call sees whether the gap is filled
        return ("standard", values[0]) if name == "check_table" else (lambda *_: np.squeeze(next(in_turn)),)

    with monkeypatch.context() as patched:
        patched.setattr(checks, "_verdict", lambda _, known, *others, **options: usual.update(known) or "")
        check(*answers(np.zeros((20, 4))))
    assert len(usual) > 3
    assert {said: check(*answers(values)) for said, values in usual.items()} == {said: said for said in usual}


@pytest.mark.parametrize("filled", [pytest.param(False, marks=pytest.mark.slow), True], ids=["gaps", "filled"])
@pytest.mark.parametrize("name", sorted(path.stem for path in LABS.glob("[0-9]*.py")))
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
