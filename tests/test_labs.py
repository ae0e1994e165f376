"""Labs: checks tell right answers from usual mistakes, and the notebook runs with gaps and without."""

import re
import sys

import numpy as np
import pytest

from notebooks import LABS, notebook_of
from test_notebooks import darkness, executed

sys.path.insert(0, str(LABS))
import checks

# closed forms, not the package's
TORQUE = "[9.81 * (1.5 * np.cos(q[0]) + 0.25 * np.cos(q[0] + q[1])), 9.81 * 0.25 * np.cos(q[0] + q[1])]"
SAG = "-np.array(torque(q_ref)) / kp"
MISTAKES = {
    TORQUE: "right",
    "[..., ...]": "not filled in yet",
    TORQUE.replace("9.81", "-9.81"): "the sign",
    TORQUE.replace("9.81 *", ""): "g = 9.81 m/s2 is missing",
    TORQUE.replace("cos", "sin"): "the angles count from the horizontal",
    TORQUE.replace("q[0] + q[1]", "q[1]"): "q[1] counts from the first rod",
    TORQUE.replace("1.5", "2.0").replace("0.25", "0.5"): "masses sit half way",
    TORQUE.replace("1.5", "0.5"): "the first joint carries the whole second rod",
    re.sub(r"cos\(([^)]*)\)", r"cos(np.rad2deg(\1))", TORQUE): "angles are in rad",
    TORQUE.replace("0.25", "0.3"): "not right, and none of the usual mistakes: both joints",
    TORQUE.replace("1.5", "1.4"): "not right, and none of the usual mistakes: joint 0 alone",
}
SAG_MISTAKES = {SAG: "right", SAG[1:]: "the sign", f"{SAG} * kp": "divide by kp", f"np.rad2deg({SAG})": "in rad"}


@pytest.mark.parametrize(("answer", "said"), MISTAKES.items())
def test_a_torque_is_right_or_its_mistake_is_told(answer, said):
    assert checks.check_torque(lambda q: eval(answer, {"np": np, "q": q})).startswith(said)


@pytest.mark.parametrize(("answer", "said"), SAG_MISTAKES.items())
def test_a_sag_is_right_or_its_mistake_is_told(answer, said):
    right = {"np": np, "torque": lambda q: eval(TORQUE, {"np": np, "q": q})}
    assert said in checks.check_sag(lambda q_ref, kp: eval(answer, right | {"q_ref": q_ref, "kp": kp}))


@pytest.mark.parametrize(("answers", "said"), [([], "not filled in yet"), ([TORQUE, SAG], "right")])
def test_the_notebook_runs_with_gaps_and_without_and_draws(tmp_path, answers, said):
    text = (LABS / "1_gravity_and_pd.py").read_text()
    for answer in answers:
        text = text.replace("[..., ...]", answer, 1)
    outputs = [one for outputs in executed(notebook_of(text), tmp_path) for one in outputs]
    printed = "".join(one.text for one in outputs if one.output_type == "stream" and one.name == "stdout")
    assert re.findall(r"^(?:right|not filled in yet)$", printed, re.MULTILINE) == [said, said]
    assert ("with your torque: by [0. 0.] deg" in printed.replace("-0.", "0.")) is bool(answers)
    pictures = [one for one in outputs if "image/png" in one.get("data", {})]
    assert [darkness(one) > 0.01 for one in pictures] == [True]
