import json
from pathlib import Path

import numpy as np
import pytest

from catenary.identification.files import load_identification
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from command_line import catenary, refusal
from moving_arm import recorded, write_npz

ARM = load_robot("raven2")
PLACE = (0.02, -0.1, 0.05)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of an arm, and one of it loaded; not to be written."""
    path = tmp_path_factory.mktemp("recordings")
    for seed in (0, 1):
        write_npz(recorded(ARM, seed, noise=0.1), path / f"run{seed}.npz")
    write_npz(recorded(ARM.with_payload("wrist", 0.2, PLACE), 2, noise=0.1), path / "loaded.npz")
    return path


@pytest.fixture(scope="module")
def parameters(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "arm.npz"
    assert catenary("identify", folder / "run0.npz", "--robot", "raven2", "--out", out).code == 0
    return out


def test_identify_prints_counts_condition_and_residuals(folder: Path, tmp_path: Path) -> None:
    content = catenary(
        "identify", folder / "run0.npz", "--robot", "raven2", "--test", folder / "run1.npz",
        "--period", 1000, "--out", tmp_path / "arm.npz", "--json",
    ).json  # fmt: skip
    assert {"n_base", "condition", "rank", "training", "tests"} <= set(content)
    assert content["n_base"] == content["rank"]
    (test,) = content["tests"]
    assert test["log"] == "run1"
    assert test["verdict"] == "holds"
    for key in ("relative_rms", "relative_rms_period", "rms"):
        assert len(test[key]) == 3
    assert content["training"][0]["verdict"] is None


def test_identify_writes_parameters_card_and_page(folder: Path, tmp_path: Path) -> None:
    out, page = tmp_path / "arm.npz", tmp_path / "arm.html"
    outcome = catenary("identify", folder / "run0.npz", "--robot", "raven2", "--out", out, "--report", page)
    assert outcome.code == 0
    assert "Residual over torque" in outcome.out
    assert load_identification(out)[0].model.name == "raven2"
    card = json.loads((tmp_path / "arm.card.json").read_text())
    assert card["data"][0]["use"] == "fitted"
    html = page.read_text()
    for words in (
        "Excitation",
        "Base parameters",
        "Torques of run0",
        "data:image/png;base64",
        "assumed friction",
    ):
        assert words in html


def test_identify_in_blocks_tests_what_it_held_out(folder: Path, tmp_path: Path) -> None:
    content = catenary(
        "identify", folder / "run0.npz", "--robot", "raven2", "--blocks", 2, "--rows", "0:4000",
        "--out", tmp_path / "arm.npz", "--json",
    ).json  # fmt: skip
    assert content["tests"][0]["log"] == "run0 (held-out blocks)"
    assert "run0: rows 0 to 4000 of 6000" in content["notes"]


def test_identify_writes_a_consistent_robot_as_urdf(folder: Path, tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    outcome = catenary(
        "identify", folder / "run0.npz", "--robot", "raven2", "--consistent", "--urdf", urdf,
        "--out", tmp_path / "arm.npz",
    )  # fmt: skip
    assert outcome.code == 0
    assert load_urdf(urdf).tree.mass.min() > 0.0


def test_identify_reads_parquet_logs(tmp_path: Path) -> None:
    from catenary.recording.logs import write_parquet

    write_parquet(recorded(ARM, 0), tmp_path / "run.parquet")
    outcome = catenary(
        "identify", tmp_path / "run.parquet", "--robot", "raven2", "--out", tmp_path / "arm.npz", "--json"
    )
    assert outcome.json["training"][0]["log"] == "run"


def test_identify_says_when_a_test_is_none(folder: Path, tmp_path: Path) -> None:
    log = folder / "run0.npz"
    outcome = catenary("identify", log, "--robot", "raven2", "--test", log, "--out", tmp_path / "arm.npz")
    assert "is one of the recordings that were fitted: no test" in outcome.err


def test_check_says_what_a_parameter_file_is(parameters: Path) -> None:
    content = catenary("check", parameters, "--json").json
    assert content["kind"] == "identified dynamics"
    assert content["facts"]["robot"] == "raven2"


def test_payload_weighs_a_mass_at_its_place(folder: Path, parameters: Path) -> None:
    content = catenary(
        "payload", folder / "loaded.npz", "--model", parameters, "--at", "wrist", *PLACE, "--json"
    ).json
    assert content["mass"] == pytest.approx(0.2, abs=0.02)
    assert content["detected"] is True
    assert content["link"] == "insertion"
    assert content["confidence"] > 0.99
    assert len(content["moment"]) == 3


def test_payload_takes_negative_places(folder: Path, parameters: Path) -> None:
    outcome = catenary(
        "payload", folder / "loaded.npz", "--model", parameters, "--at", "wrist", "-0.1", "-0.1", "0"
    )
    assert outcome.code == 0
    assert "mass:" in outcome.out


def test_payload_anywhere_names_the_link_and_the_others(folder: Path, parameters: Path) -> None:
    outcome = catenary("payload", folder / "loaded.npz", "--model", parameters)
    assert "payload on insertion" in outcome.out
    assert "Other links" in outcome.out


def test_no_payload_is_said(folder: Path, parameters: Path) -> None:
    outcome = catenary("payload", folder / "run1.npz", "--model", parameters, "--at", "wrist", *PLACE)
    assert outcome.out.startswith("no payload")
    unloaded = ["--unloaded", folder / "run1.npz", "--cutoff-hz", 5]
    content = catenary("payload", folder / "run1.npz", "--model", parameters, *unloaded, "--json").json
    assert content["detected"] is False


def test_excitation_designs_poses_and_motions(tmp_path: Path) -> None:
    poses, motion = tmp_path / "poses.npz", tmp_path / "motion.csv"
    content = catenary("excitation", "panda", "--static", 10, "--out", poses, "--json").json
    assert content["rows"] == 10
    with np.load(poses, allow_pickle=False) as archive:
        assert archive["q"].shape == (10, 7)
    outcome = catenary("excitation", "panda", "--trials", 3, "--period-s", 5, "--out", motion)
    assert "1001 rows, 5 s" in outcome.out
    lines = motion.read_text().splitlines()
    assert lines[0].startswith("t,q:q1")
    assert len(lines) == 1002


def test_excitation_of_a_robot_without_limits_takes_them(tmp_path: Path) -> None:
    bounds = ["--lower=-1,-0.7,0.05,-1,-1,-1,-1", "--upper", "1,0.7,0.2,1,1,1,1"]
    content = catenary(
        "excitation", "dvrk_psm", "--static", 12, *bounds, "--out", tmp_path / "p.npz", "--json"
    ).json
    assert content["terms"] == "static"


RUN = recorded(ARM, 0, seconds=4.0)


def log(tmp_path: Path, **changes: object) -> Path:
    write_npz(RUN, tmp_path / "log.npz", **changes)
    return tmp_path / "log.npz"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": np.full((800, 3), np.nan)}, ": q is nan at row 0"),
        ({"tau": np.full((800, 3), np.inf)}, "tau is inf at row 0"),
        ({"q": None}, "expected arrays q (N, n) and tau (N, n)"),
        ({"t": None}, "full dynamics need `fs` [Hz] or `t` [s]"),
        ({"t": None, "fs": 0.0}, "expected a rate above zero"),
        ({"tau": np.zeros((5, 3))}, "tau: expected shape (800, 3), got (5, 3)"),
        ({"tau": None, "effort": np.zeros((800, 3))}, "gives no effort_scale"),
        ({"q": np.rad2deg(RUN.q_nominal)}, "is it in degrees"),
        ({"dq": RUN.qd[:, [1, 0, 2]]}, "swapped axes?"),
        (
            {"q": np.repeat(RUN.q_nominal[:1], 800, axis=0), "dq": np.zeros((800, 3))},
            "base parameters (condition",
        ),
        (
            {"q": RUN.q_nominal[:, :2], "dq": RUN.qd[:, :2], "tau": RUN.tau[:, :2]},
            'has 2 joints, robot "raven2" has 3',
        ),
        (
            {"q": RUN.q_nominal[:90], "dq": RUN.qd[:90], "tau": RUN.tau[:90], "t": RUN.time[:90]},
            "shorter than the filter",
        ),
        ({"tau": np.array([["a"] * 3] * 800)}, "tau: expected numbers"),
    ],
)
def test_a_recording_that_cannot_be_used_is_refused(tmp_path: Path, changes: dict, words: str) -> None:
    arguments = ["identify", log(tmp_path, **changes), "--robot", "raven2", "--out", tmp_path / "o.npz"]
    assert words in refusal(*arguments)
    assert not (tmp_path / "o.npz").exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--robot", "raven9"], 'did you mean "raven2"'),
        (["--robot", "raven2", "--terms", "half"], "expected full or static"),
        (["--robot", "raven2", "--weighting", "best"], "expected none, range"),
        (["--robot", "raven2", "--cutoff-hz", "0"], "cutoff_hz: expected a number above zero"),
        (["--robot", "raven2", "--rows", "5"], "--rows: expected FIRST:LAST"),
        (["--robot", "raven2", "--rows", "0:9000"], "has rows 0 to 800, got 0:9000"),
        (["--robot", "raven2", "--gravity", "1,2"], "--gravity: expected 3 numbers"),
        (["--robot", "raven2", "--urdf", "a.urdf"], "add --consistent"),
        (["--robot", "raven2", "--test", "none.npz"], "none.npz: no such file"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(tmp_path: Path, more: list[str], words: str) -> None:
    assert words in refusal("identify", log(tmp_path), "--out", tmp_path / "o.npz", *more)


def test_a_recording_is_never_overwritten(tmp_path: Path) -> None:
    path = log(tmp_path)
    assert "is a file that is read here" in refusal("identify", path, "--robot", "raven2", "--out", path)
    out = tmp_path / "a.npz"
    message = refusal("identify", path, "--robot", "raven2", "--out", out, "--report", out)
    assert "something else is written there" in message


def test_a_model_without_inertia_gives_no_torques_and_names_its_links(tmp_path: Path) -> None:
    path = tmp_path / "psm.npz"
    np.savez(path, q=np.zeros((4, 7)))
    assert "written by catenary identify" in refusal("payload", path, "--model", path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["panda", "--static", "2"], "2 poses cannot show"),
        (["panda", "--static", "2", "--fourier"], "one of --static and --fourier"),
        (["panda", "--harmonics", "1"], "three or more harmonics"),
        (["dvrk_psm"], "no lower limit of q1: give --lower"),
        (["panda", "--upper", "1,2"], "upper: expected shape (7,)"),
    ],
)
def test_designs_that_cannot_be_are_refused(tmp_path: Path, arguments: list[str], words: str) -> None:
    assert words in refusal("excitation", *arguments, "--out", tmp_path / "x.npz")


def test_a_design_of_another_ending_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "x.txt"
    assert "expected .npz or .csv" in refusal("excitation", "panda", "--static", 9, "--out", out)
