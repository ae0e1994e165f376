import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model_file import save_model
from catenary.control.realtime import Timing
from catenary.errors import TransportError
from catenary.nodes.calibrated_topics import CalibratedTopics
from catenary.plant import MotionLog
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import RECOMMENDED
from command_line import catenary, refusal
from oracles.crtk_robot import RobotOnLoopback
from recordings import fitted
from simulated_project import QUICK_MODELS


@pytest.fixture(scope="module")
def raven_model(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the recorded project's robot."""
    path = tmp_path_factory.mktemp("model") / "raven.npz"
    line = ("fit", recorded / "train.parquet", "--model", "linear", "--folds", "0", "--out", path)
    assert catenary(*line).code == 0
    return path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Linear models, and two seconds in the loop."""
    monkeypatch.setattr(calibrate, "models_for", lambda *_: QUICK_MODELS)
    monkeypatch.setattr(calibrate, "_DEPLOY_S", 2.0)


@pytest.fixture
def _no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """No page, whose pictures take seconds to draw."""
    monkeypatch.setattr(calibrate, "write_project_report", lambda page, *_, **__: page.write_text("a page"))


def test_home_homes_another_robot(project_folder: Path) -> None:
    outcome = catenary("home", project_folder, "--seed", 2, "--payload", "0.1", "--base-tilt-deg", "3,-2")
    assert outcome.code == 0, outcome
    assert "homed\n" in outcome.out
    settings = json.loads((project_folder / "settings.json").read_text())
    assert (settings["seed"], settings["payload_kg"], settings["base_tilt_deg"]) == (2, 0.1, [3.0, -2.0])


def test_extract_writes_logs_and_bags(project_folder: Path) -> None:
    outcome = catenary("extract", project_folder)
    assert "longest gap [ms]" not in outcome.err
    assert "/ravenstate" in outcome.out
    content = catenary("extract", project_folder, "--bag", "ros1", "--json").json
    assert set(content) == {"train", "test"}
    for found in content.values():
        assert all(Path(file).is_file() for file in (found["log"], *found["bags"]))


def test_deploy_tells_errors_and_latency(recorded: Path, raven_model: Path) -> None:
    line = ("deploy", raven_model, recorded, "--seconds", "2", "--fast")
    content = catenary(*line, "--json").json
    assert [joint["unit"] for joint in content["joints"]] == ["deg", "deg", "mm"]
    assert content["correction_us"]["median"] > 0.0
    assert "RMSE while the loop ran" in catenary(*line).out


def test_a_loop_of_no_length_or_of_another_model_is_refused(recorded: Path, raven_model: Path, model: Path) -> None:
    for seconds in ("nan", "inf", "0", "-1"):
        assert "duration" in refusal("deploy", raven_model, recorded, f"--seconds={seconds}")
    assert "J1" in refusal("deploy", model, recorded, "--seconds", "2", "--fast")


@pytest.mark.usefixtures("_no_page")
def test_calibrate_does_what_is_missing_and_no_more(project_folder: Path, quick: None) -> None:
    first = catenary("calibrate", project_folder)
    corrector = re.search(r"the corrector takes ([\d.]+) us a tick", first.out)
    loop = re.search(r"1 kHz loop, reading and commanding the simulated robot included: .* median (\d+) us", first.out)
    assert corrector
    assert loop
    assert float(corrector[1]) < float(loop[1]) + 1.0  # rounded
    assert "None" not in first.out  # where nobody counted overruns
    assert "nothing to do" not in first.out
    assert "deploy" in first.err  # its steps
    assert "deploy\n" not in first.out
    assert catenary("calibrate", project_folder, "--json").json["steps_run"] == []
    assert "nothing to do: every step is done already" in catenary("calibrate", project_folder).out


@pytest.mark.usefixtures("_no_page")
def test_calibrate_takes_the_options_of_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = calibrate.models_for
    monkeypatch.setattr(calibrate, "models_for", lambda *asked: {RECOMMENDED: every(*asked)[RECOMMENDED]})
    train, test = (simulated_arm.write(tmp_path / f"{k}.npz", seed=k) for k in (1, 2))
    options = ("--model", "linear", "--play", "0.1", "--inputs", "q:J1,q:J2", "--ridge", 1, "--held-out", 0.25)
    tested = ("--folds", 3, "--coverage", 0.8, "--max-error", "9,9,9", "--target", "position", "--seed", 4)
    line = ("calibrate", tmp_path / "p", train, "--test", test, *options, *tested)
    assert catenary(*line).code == 0
    card = json.loads((tmp_path / "p" / "models" / f"{RECOMMENDED}.card.json").read_text())
    assert (card["kind"], card["target"]) == ("linear", "position")
    assert card["settings"]["play_shares"] == [0.1]
    assert card["settings"]["inputs"] == ["q:J1", "q:J2"]
    assert card["settings"]["ridge"] == 1.0
    run = card["run"]
    assert (run["held_out"], run["folds"], run["coverage"], run["seed"]) == (0.25, 3, 0.8, 4)
    assert run["max_error"] == [9.0, 9.0, 9.0]
    assert "expected one of raven2, dvrk_psm, got panda" in refusal("calibrate", tmp_path / "q", "--robot", "panda")
    assert not (tmp_path / "q").exists()


@pytest.mark.usefixtures("_no_page")
def test_calibrate_warns_of_a_recommended_model_that_does_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = {f"J{j}": (f"q:J{j}",) for j in (1, 2, 3)}  # so that a joint's valid range is its own
    models = {name: FitOptions(kind="linear", inputs=own) for name in QUICK_MODELS}
    monkeypatch.setattr(calibrate, "models_for", lambda *_: models)
    train = simulated_arm.write(tmp_path / "train.npz", seed=1)
    elsewhere = simulated_arm.arrays(seed=2)
    slope = elsewhere["q_act"] - elsewhere["q_des"]
    elsewhere["q_act"][:, 1] -= 2.0 * (slope[:, 1] - slope[:, 1].mean())  # J2's ratio has turned round
    elsewhere["q_des"][:, 2] += 0.3  # J3 is where it never was
    elsewhere["q_act"][:, 2] += 0.3
    np.savez(tmp_path / "test.npz", **elsewhere)
    accept = ("--accept", "scale", "--accept", "units")
    line = ("calibrate", tmp_path / "p", train, "--test", tmp_path / "test.npz", *accept)
    outcome = catenary(*line)
    assert outcome.code == 0, outcome
    assert "warning: J2: the model is worse than the fixed offset here" in outcome.out
    assert "warning: J3: 100% of rows lie outside the model's valid range" in outcome.out
    assert "J1: the model is worse" not in outcome.out
    assert len(catenary(*line, "--json").json["advice"]) == 2


def test_commands_on_a_finished_project_write_nothing(finished_folder: Path, quick: None) -> None:
    def state() -> dict[str, tuple[int, int, int, int]]:
        paths = [finished_folder, *finished_folder.rglob("*")]
        return {str(p): (s.st_ino, s.st_mtime_ns, s.st_ctime_ns, s.st_size) for p in paths for s in [p.stat()]}

    model, log = finished_folder / "models" / "linear.npz", finished_folder / "test.parquet"
    before = state()
    for command in (
        ("home", finished_folder),
        ("excite", finished_folder),
        ("extract", finished_folder),
        ("calibrate", finished_folder),
        ("evaluate", model, log),
        ("check", log),
        ("deploy", model, finished_folder, "--seconds", "2", "--fast"),
    ):
        outcome = catenary(*command)
        assert outcome.code == 0, outcome
        assert state() == before, command


@pytest.mark.usefixtures("_no_page")
def test_torn_files_of_a_finished_project_are_made_again(finished_folder: Path, quick: None) -> None:
    names = ("evaluation.json", "deployment.json", "robot/home.json", "models/linear.card.json")
    whole = {name: (finished_folder / name).read_bytes() for name in names}
    for name, content in whole.items():
        (finished_folder / name).write_bytes(content[: len(content) // 2])
    assert catenary("calibrate", finished_folder).code == 0
    evaluation, deployment, *others = ((finished_folder / name).read_bytes() for name in names)
    assert json.loads(evaluation)["models"] == json.loads(whole["evaluation.json"])["models"]  # of a folder elsewhere
    assert json.loads(deployment).keys() == json.loads(whole["deployment.json"]).keys()  # times of the loop differ
    assert others == [whole[name] for name in names[2:]]
    assert catenary("calibrate", finished_folder, "--json").json["steps_run"] == []


@pytest.fixture
def beside(on_ros: RobotOnLoopback, tmp_path: Path) -> Path:
    """A model for a robot on ROS that is homing."""
    on_ros.robot.plant.state_command("home")
    q = np.random.default_rng(0).uniform(0.3, 0.4, (400, 3))
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    log = MotionLog("run", names, units, q, np.ones(400, dtype=bool), q + 0.01, time=np.arange(400) / 30.0)
    inputs = tuple(f"q:{name}" for name in names)
    path = tmp_path / "arm.npz"
    save_model(fitted(log, kind="linear", inputs=inputs), {}, path)
    return path


def test_a_deployment_reports_whatever_ends_it(
    on_ros: RobotOnLoopback, beside: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def ends(topics: CalibratedTopics, seconds: float) -> Any:
        calls.append(seconds)
        if len(calls) == 3:
            raise TransportError("the ROS node was shut down")
        for _ in range(100):
            on_ros.transport.sleep(0.001)
        topics.step()
        return topics.report()

    monkeypatch.setattr(CalibratedTopics, "run", ends)
    outcome = catenary("deploy", beside, "--ros", 1, "--json")
    assert outcome.code == 2
    assert "the ROS node was shut down" in outcome.err
    assert outcome.json["messages"] > 0


@pytest.mark.parametrize(("median", "code"), [(2e-4, 0), (3.4e-3, 1)])
def test_deploy_beside_a_robot(beside: Path, monkeypatch: pytest.MonkeyPatch, median: float, code: int) -> None:
    report = CalibratedTopics.report

    def timed(topics: CalibratedTopics) -> Any:
        found = vars(report(topics)) | {"rate_hz": 1000.0, "latency": Timing(median, median, median, median)}
        return type(report(topics))(**found)

    def ends(topics: CalibratedTopics, seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(CalibratedTopics, "report", timed)
    monkeypatch.setattr(CalibratedTopics, "run", ends)
    outcome = catenary("deploy", beside, "--ros", 1, "--json")
    assert outcome.code == code
    assert outcome.json["keeps_up"] is (code == 0)
    assert ("3.40 ms in the median" in outcome.err) is (code == 1)
