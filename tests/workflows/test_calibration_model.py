"""A calibration model's file and recordings: fitted, evaluated, refreshed, whatever the recordings' make and mends."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import simulated_arm
from catenary.calibration.calibration import fit, load_model
from catenary.calibration.corrector import Corrector
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.model_file import save_model
from catenary.errors import DataError, InputError
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification_file import save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.plant import MotionLog
from catenary.recording.import_formats.mapping import mapping_of
from catenary.recording.logs import Reading, read_log, write_parquet
from catenary.robots.catalog import load_robot
from catenary.verdict.corrections import Mend
from catenary.view.replay import recorded_arm
from catenary.workflows.calibration_model import fit_calibration, held_against, recording_for
from catenary.workflows.identify import identify_files, payload_of_files
from catenary.workflows.import_recording import import_recording
from lab_bags import JOINT_STATE, joint_state, write_bag
from moving_arm import PLACE, recorded, write_npz

ARM, UR = load_robot("raven2"), load_robot("ur10e")
LINEAR = FitOptions(kind="linear")
QUICK = IdentifyOptions(prior=False, friction=())  # in a third of the time
NAMES, UNITS = ("yaw", "pitch", "slide"), ("rad", "rad", "m")
TURNED = [2, 0, 1]


def day(seed: int, zero: float = 0.0) -> MotionLog:
    """A recording of 800 rows whose joints are off by known shares, and by a zero."""
    rng, t = np.random.default_rng(seed), np.arange(800) / 30.0
    pace, phase = rng.uniform(0.3, 0.9, 3), rng.uniform(0.0, 6.0, 3)
    q = np.array([0.5, 0.4, 0.05]) * np.sin(t[:, None] * pace + phase) + np.array([0.0, 0.0, 0.1])
    error = np.array([0.02, -0.03, 0.001]) * (1.0 + zero) + np.array([0.05, 0.04, 0.02]) * q
    noise = np.array([1e-4, 1e-4, 1e-5]) * rng.standard_normal(q.shape)
    return MotionLog(f"day{seed}", NAMES, UNITS, q, np.ones(len(q), bool), q + error + noise, t)


def reordered(log: MotionLog, order: Sequence[int]) -> MotionLog:
    """The same recording with its joints in another order, by their names."""
    arrays: dict[str, Any] = {
        key: getattr(log, key)[:, order]
        for key in ("q_nominal", "q_encoder", "qd", "tau")
        if getattr(log, key) is not None
    }
    names = tuple(log.joint_names[j] for j in order)
    return replace(log, joint_names=names, joint_units=tuple(log.joint_units[j] for j in order), **arrays)


def as_parquet(log: MotionLog, path: Path) -> Path:
    write_parquet(log, path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def as_npz(log: MotionLog, path: Path) -> Path:
    path = path.with_suffix(".npz")
    np.savez(
        path, q_des=log.q_nominal, q_act=log.q_encoder, ok=log.ok, t=log.time, units=log.joint_units,
        joint_names=log.joint_names,
    )  # fmt: skip
    return path


def torques_as_npz(log: MotionLog, path: Path) -> Path:
    write_npz(log, path.with_suffix(".npz"), joint_names=log.joint_names)
    return path.with_suffix(".npz")


def write_csv(path: Path, head: str, rows: np.ndarray) -> None:
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.9g")


# calibration


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "arm.npz"
    result = fit_calibration([as_parquet(day(0), path.with_name("day0"))], LINEAR)
    save_model(result.model, result.card, path)
    return path


@pytest.mark.alike
@pytest.mark.parametrize("written", [as_parquet, as_npz])
@pytest.mark.parametrize("command", ["evaluate", "drift", "refresh"])
def test_a_recording_in_any_order_of_joints_gives_a_model_the_same_numbers(
    command: str, written: Callable[[MotionLog, Path], Path], model: Path, tmp_path: Path
) -> None:
    found = []
    for order in ([0, 1, 2], TURNED):
        held = held_against(model, [written(reordered(day(1, 0.3), order), tmp_path / f"{order[0]}")])
        result = getattr(held, command)()
        if command == "evaluate":
            found.append([joint.rmse for joint in result.evaluation.joints])
        elif command == "drift":
            found.append(result[0].stretches[0].rmse)
        else:
            found.append([change.moved for change in result.refreshed.changes])
    assert_allclose(found[1], found[0], rtol=1e-12)


@given(st.permutations([0, 1, 2]))
@settings(max_examples=6)
def test_calibrated_joints_are_those_of_their_names(order: list[int]) -> None:
    made, log = fit(day(0), model="linear", folds=0), day(1)
    assert_array_equal(made.calibrate(reordered(log, order)), made.calibrate(log))
    assert_allclose(made.calibrate(log), log.q_encoder, atol=1e-3)  # the truth, but for noise


def test_a_recording_is_shown_by_the_names_of_its_joints(tmp_path: Path) -> None:
    log = recorded(ARM, 0, seconds=1.0)
    right, turned = (recorded_arm(each, ARM) for each in (log, reordered(log, TURNED)))
    assert_array_equal(turned.rows["q"], right.rows["q"])


def test_other_joints_are_refused_with_both_sides(model: Path, tmp_path: Path) -> None:
    other = as_parquet(replace(day(1), joint_names=("left/yaw", "pitch", "slide")), tmp_path / "other")
    with pytest.raises(InputError, match=r'no joint "yaw"; it has left/yaw.* the model is for yaw.*is "left/yaw"'):
        held_against(model, [other]).evaluate()


def test_joints_without_names_are_taken_in_order_and_it_is_said(model: Path, tmp_path: Path) -> None:
    nameless = as_parquet(replace(day(1), joint_names=("J1", "J2", "J3")), tmp_path / "nameless")
    result = held_against(model, [nameless]).evaluate()
    assert any("without names, in order as yaw, pitch, slide" in note for note in result.notes)


def test_names_that_a_file_states_are_matched_with_those_that_are_given(tmp_path: Path) -> None:
    log = read_log(as_npz(reordered(day(0), TURNED), tmp_path / "x"), units=UNITS, joint_names=NAMES)
    assert_array_equal(log.q_nominal, day(0).q_nominal)


# identification


def at_rest(seed: int, count: int = 300) -> MotionLog:
    """Poses at rest of a UR10e, whose topics name joints by the alphabet."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-3.0, 3.0, (count, UR.n))
    tau = gravity_torque(UR, q, [0.0, 0.0, -9.81]) + rng.normal(0.0, 0.05, q.shape)
    return MotionLog("rest", UR.joint_names, UR.joint_units, q, np.ones(count, bool), tau=tau)


ALPHABETIC = list(np.argsort(UR.joint_names))
STATIC = IdentifyOptions(terms="static", friction=())


def as_csv(log: MotionLog, path: Path) -> tuple[Path, list[str]]:
    """A table with a column for each joint, named after it, and its mapping."""
    heads = [f"{kind}_{name.removesuffix('_joint')}" for kind in ("pos", "effort") for name in log.joint_names]
    write_csv(path.with_suffix(".csv"), ",".join(heads), np.column_stack([log.q_nominal, log.tau]))
    return path.with_suffix(".csv"), [f"q_nominal={','.join(heads[: len(log.joint_names)])}", "tau=effort_*"]


def as_bag(log: MotionLog, path: Path) -> tuple[Path, list[str]]:
    states = [
        (0.1 * k, "/joint_states", joint_state(log.joint_names, q.copy(), (), tau.copy()))
        for k, (q, tau) in enumerate(zip(log.q_nominal, log.tau, strict=True))
    ]
    bag = write_bag(path, "ros1", {"/joint_states": JOINT_STATE}, states)
    return bag, ["q_nominal=/joint_states.position", "tau=/joint_states.effort"]


@pytest.mark.parametrize("written", [as_parquet, torques_as_npz])
def test_the_gravity_that_is_identified_is_the_arm_s_whatever_the_order_of_joints(
    written: Callable[[MotionLog, Path], Path], tmp_path: Path
) -> None:
    path = written(reordered(at_rest(0), ALPHABETIC), tmp_path / "ur")
    found = identify_files([path], "ur10e", STATIC).identification
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (50, UR.n))
    true = gravity_torque(UR, q, [0.0, 0.0, -9.81])
    assert_allclose(gravity_torque(found.robot(), q, [0.0, 0.0, -9.81]), true, atol=0.1)  # of 100 Nm; noise is 0.05


# import


@pytest.mark.parametrize("container", [as_csv, as_bag])
@given(order=st.permutations(range(6)))
@settings(max_examples=4)
def test_an_import_names_joints_as_the_recording_does(
    container: Callable[[MotionLog, Path], tuple[Path, list[str]]],
    order: list[int],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    log = at_rest(0, 30)
    path, options = container(reordered(log, order), tmp_path_factory.mktemp("ur") / "ur")
    found = import_recording(path, options, units="rad", robot="ur10e")
    assert found.joint_names == UR.joint_names
    assert_allclose(found.q_nominal, log.q_nominal, atol=1e-8)
    assert_allclose(found.tau, log.tau, atol=1e-8)


def test_joints_that_are_not_clearly_the_robot_s_are_refused(tmp_path: Path) -> None:
    heads = ["q_elbow", "q_b", "q_c"]
    path = tmp_path / "some.csv"
    path.write_text(",".join(heads) + "\n" + "0.1,0.2,0.3\n" * 5)
    with pytest.raises(InputError, match=r"q_elbow, q_b, q_c are not clearly joints of robot \"ur10e\""):
        import_recording(path, ["q_nominal=q_elbow,q_b,q_c"], units="rad", robot="ur10e")
    bag, _ = as_bag(replace(at_rest(0, 20), joint_names=tuple("abcdef")), tmp_path / "lab")
    with pytest.raises(InputError, match="a, b, c, d, e, f are not clearly joints"):
        import_recording(bag, ["q_nominal=/joint_states.position"], robot="ur10e")
    listed = ",".join(f"/joint_states.position[{name}]" for name in "abcdef")
    assert import_recording(bag, [f"q_nominal={listed}"], robot="ur10e").joint_names == UR.joint_names


def test_a_pattern_keeps_the_file_s_order_pairs_by_its_words_and_is_shown_as_its_columns(tmp_path: Path) -> None:
    path, t = tmp_path / "lab.csv", np.arange(0.0, 4.0, 0.02)
    q = np.column_stack([40.0 * np.sin(t), 30.0 * np.cos(t), 50.0 + 20.0 * np.sin(0.7 * t)])
    rows = np.column_stack([t, q, q[:, ::-1] + 0.01])
    write_csv(path, "t,cmd_yaw,cmd_pitch,cmd_ins,enc_ins,enc_pitch,enc_yaw", rows)
    log = import_recording(path, ["q_nominal=cmd_*", "q_encoder=enc_*"], units="deg,deg,mm")
    assert log.joint_units == ("rad", "rad", "m")
    assert_allclose(log.q_nominal, q * [np.pi / 180.0, np.pi / 180.0, 1e-3], atol=1e-6)
    assert_allclose(log.q_encoder, (q + 0.01) * [np.pi / 180.0, np.pi / 180.0, 1e-3], atol=1e-6)
    assert "q_nominal = cmd_yaw, cmd_pitch, cmd_ins" in log.notes[0]


def test_what_is_said_of_units_holds_for_measurements_too(tmp_path: Path) -> None:
    path, t = tmp_path / "lab.csv", np.arange(0.0, 4.0, 0.02)
    q = np.column_stack([0.4 * np.sin(t), 0.3 * np.cos(t)])
    seen = 0.5 * q  # neither degrees nor radians by its range
    write_csv(path, "time_s,cmd_yaw,cmd_pitch,cam_yaw,cam_pitch", np.column_stack([t, q, seen]))
    log = import_recording(path, units="rad,rad", accept_proposal=True)
    assert_allclose(log.q_encoder, seen, atol=1e-6)
    table = import_recording(
        path, {"q_nominal": {"columns": ["cmd_yaw"]}, "qd": {"columns": ["cmd_pitch"]}}, units="deg"
    )
    assert_allclose(table.qd, np.deg2rad(q[:, 1:]), atol=1e-8)


# mends


def spoilt(log: MotionLog) -> MotionLog:
    """Measurements four rows late, of which one joint counts the other way."""
    assert log.q_encoder is not None
    late, ok = np.roll(log.q_encoder, 4, axis=0), log.ok.copy()
    ok[:4] = False
    return replace(log, q_encoder=late * [1.0, -1.0, 1.0], ok=ok)


MEND = Mend(sign=("pitch",), shift=4)


@pytest.fixture(scope="module")
def mended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of a spoilt recording that was mended."""
    path = tmp_path_factory.mktemp("mended") / "arm.npz"
    raw = as_parquet(spoilt(day(0)), path.with_name("day0"))
    result = fit_calibration([raw], LINEAR, reading=Reading(mend=MEND))
    save_model(result.model, result.card, path)
    return path


def rmse(model: Path, log: Path, reading: Reading | None = None) -> tuple[list[float], tuple[str, ...]]:
    result = held_against(model, [log], reading).evaluate()
    return [joint.rmse for joint in result.evaluation.joints], result.notes


SAID = "corrected as the model's training data: --sign q_encoder:pitch --shift 4; --as-is disables this"


def test_the_card_holds_its_mends_as_data(mended: Path) -> None:
    loaded = load_model(mended)
    assert loaded.card["mends"] == {"sign:q_encoder": ["q_encoder:pitch"], "shift": ["4"]}
    assert loaded.mends == {"sign:q_encoder": ("q_encoder:pitch",), "shift": ("4",)}


def test_joints_without_names_are_mended_by_the_model_s(mended: Path, tmp_path: Path) -> None:
    nameless = as_parquet(replace(spoilt(day(1)), joint_names=("J1", "J2", "J3")), tmp_path / "nameless")
    assert_allclose(rmse(mended, nameless)[0], 0.0, atol=0.02)


def test_python_mends_recordings_as_the_command_does(mended: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = load_model(mended).evaluate(spoilt(day(1)))
    assert_allclose([joint.rmse for joint in found.joints], 0.0, atol=0.02)
    assert SAID in caplog.text


def test_a_payload_is_weighed_by_names_of_joints_and_torques_mended_as_those_of_the_identification(
    tmp_path: Path,
) -> None:
    def turned(log: MotionLog, name: str, order: Sequence[int] = (0, 1, 2)) -> Path:
        assert log.tau is not None
        return torques_as_npz(reordered(replace(log, tau=log.tau * [1.0, -1.0, 1.0]), order), tmp_path / name)

    reading = Reading(mend=Mend(sign=("tau:elbow",)))
    result = identify_files([turned(recorded(ARM, 0, noise=0.1), "u")], "raven2", QUICK, reading=reading)
    save_identification(result.identification, result.card, tmp_path / "arm.npz")
    heavy = 1.5  # [kg], three times what the insertion's torque is of
    loaded = turned(recorded(ARM.with_payload("wrist", heavy, PLACE), 2, noise=0.1), "l", TURNED)
    (payload,), notes = payload_of_files([loaded], tmp_path / "arm.npz", at=("wrist", PLACE))
    assert payload.mass == pytest.approx(heavy, abs=0.05)
    assert any("--sign tau:elbow; --as-is" in note for note in notes)


@pytest.mark.parametrize("order", [[0, 1, 2], TURNED])
def test_a_recording_is_mended_as_the_model_s_training_data_and_it_is_said(
    order: list[int], mended: Path, tmp_path: Path
) -> None:
    raw = as_parquet(reordered(spoilt(day(1)), order), tmp_path / "raw")
    errors, notes = rmse(mended, raw)
    assert any(note.endswith(SAID) for note in notes)
    assert_allclose(errors, 0.0, atol=0.02)  # [deg, mm] noise alone: the truth is linear
    assert any(note.endswith(SAID) for note in held_against(mended, [raw]).drift()[1])
    assert any(note.endswith(SAID) for note in held_against(mended, [raw]).refresh().notes)


def test_nothing_is_mended_where_it_is_switched_off_and_the_same_step_asked_for_replaces_it(
    mended: Path, tmp_path: Path
) -> None:
    raw, late = (as_parquet(each, tmp_path / each.name) for each in (spoilt(day(1)), replace(day(2), name="late")))
    with pytest.raises(DataError, match=r"--delay 0\.133"):
        held_against(mended, [raw], Reading(as_trained=False)).evaluate()
    assert_allclose(rmse(mended, late, Reading(as_trained=False))[0], 0.0, atol=0.02)
    with pytest.raises(DataError, match=r'"late" was corrected as the model\'s training data: --sign'):
        held_against(mended, [late]).evaluate()
    turned = as_parquet(
        replace(spoilt(day(2)), q_encoder=np.roll(day(2).q_encoder, 8, axis=0), ok=np.arange(800) >= 8),
        tmp_path / "eight",
    )
    notes = rmse(mended, turned, Reading(mend=Mend(shift=8, sign=("yaw", "yaw"))))[1]
    assert not any("training data" in note for note in notes)


def test_a_recording_that_was_mended_before_it_was_written_is_not_mended_twice(mended: Path, tmp_path: Path) -> None:
    kept = as_parquet(MEND(spoilt(day(1))), tmp_path / "kept")
    errors, notes = rmse(mended, kept)
    assert_allclose(errors, 0.0, atol=0.02)
    assert not any("training data" in note for note in notes)


def test_what_a_mapping_says_of_signs_is_not_mended_again(mended: Path, tmp_path: Path) -> None:
    log, path = spoilt(day(1)), tmp_path / "lab.csv"
    assert log.q_encoder is not None
    heads = ["t", *(f"cmd_{n}" for n in NAMES), *(f"enc_{n}" for n in NAMES), "ok"]
    write_csv(path, ",".join(heads), np.column_stack([log.time, log.q_nominal, log.q_encoder, log.ok]))
    options = ["q_nominal=cmd_*", "q_encoder=enc_yaw,-enc_pitch,enc_slide", "ok=ok"]
    errors, notes = rmse(mended, path, Reading(mapping=mapping_of(options, units="rad,rad,m")))
    assert_allclose(errors, 0.0, atol=0.02)
    assert any("training data: --shift 4;" in note for note in notes)


def in_degrees(log: MotionLog, path: Path) -> Path:
    factor = np.array([np.rad2deg(1.0), np.rad2deg(1.0), 1e3])
    np.savez(path, q_des=log.q_nominal * factor, q_act=log.q_encoder * factor, ok=log.ok, t=log.time)
    return path


def test_units_are_mended_where_numbers_are_in_those_of_training_and_left_where_they_are_si(tmp_path: Path) -> None:
    result = fit_calibration(
        [in_degrees(day(0), tmp_path / "0.npz")], LINEAR,
        reading=Reading(units=UNITS, joint_names=NAMES, mend=Mend(units=("deg,deg,mm",))),
    )  # fmt: skip
    save_model(result.model, result.card, tmp_path / "arm.npz")
    errors, notes = rmse(tmp_path / "arm.npz", in_degrees(day(1), tmp_path / "1.npz"))
    assert_allclose(errors, 0.0, atol=0.02)
    assert any("--units deg,deg,mm; --as-is" in note for note in notes)
    si = tmp_path / "si.npz"
    log = day(2)
    np.savez(si, q_des=log.q_nominal, q_act=log.q_encoder, ok=log.ok, t=log.time)
    assert_array_equal(recording_for(load_model(tmp_path / "arm.npz"), si).q_nominal, log.q_nominal)


def test_errors_beyond_those_of_training_are_left_out_and_it_is_said(tmp_path: Path) -> None:
    log = day(0)
    assert log.q_encoder is not None
    result = fit_calibration([as_parquet(log, tmp_path / "0")], LINEAR, FitRun(max_error=(10.0, 10.0, 20.0)))
    save_model(result.model, result.card, tmp_path / "arm.npz")
    far = day(1).q_encoder.copy()  # type: ignore[union-attr]
    far[100:103, 0] += 1.0
    path = as_parquet(replace(day(1), q_encoder=far), tmp_path / "far")
    errors, notes = rmse(tmp_path / "arm.npz", path)
    assert_allclose(errors, 0.0, atol=0.02)
    assert any("--max-error 10,10,20; --as-is takes all rows" in note for note in notes)
    assert rmse(tmp_path / "arm.npz", path, Reading(as_trained=False))[0][0] > 1.0


@pytest.mark.parametrize(
    ("mends", "refused"),
    [
        ({"sign:q_nominal": ("q_nominal:yaw",)}, True),
        ({"sign:q_encoder": ("q_encoder:yaw",), "shift": ("4",), "units": ("yaw=deg",)}, False),
        ({"sign:tau": ("tau:yaw",)}, False),  # the model takes no torques
    ],
)
def test_a_robot_that_reports_otherwise_than_the_training_data_were_mended_to_be_is_refused(
    mends: dict[str, tuple[str, ...]], refused: bool
) -> None:
    corrector = Corrector(replace(fit(day(0), model="linear", folds=0), mends=mends))
    if refused:
        with pytest.raises(InputError, match=r"corrected by --sign q_nominal:yaw.*deploy --as-is"):
            corrector.prepare(NAMES, UNITS, 1000.0)
    else:
        corrector.prepare(NAMES, UNITS, 1000.0)


@pytest.fixture
def recording_path(tmp_path: Path) -> Path:
    return simulated_arm.write(tmp_path / "run.npz")


def test_held_out_errors_are_those_of_evaluating_the_same_rows(recording_path: Path, tmp_path: Path) -> None:
    result = fit_calibration([recording_path], LINEAR, FitRun(held_out=0.25))
    save_model(result.model, result.card, tmp_path / "model.npz")
    late = {key: np.array(values)[300:] for key, values in simulated_arm.arrays().items() if key != "units"}
    np.savez(tmp_path / "late.npz", **late)
    evaluation = held_against(tmp_path / "model.npz", [tmp_path / "late.npz"]).evaluate().evaluation
    assert result.held_out is not None
    assert evaluation.joints == result.held_out.joints


def test_the_held_out_part_is_not_fitted_to(tmp_path: Path) -> None:
    early = simulated_arm.arrays()
    changed = early["q_act"].copy()
    changed[300:] += 1.0
    paths = [simulated_arm.write(tmp_path / "a.npz"), simulated_arm.write(tmp_path / "b.npz", q_act=changed)]
    run = FitRun(held_out=0.25, folds=0, accept=("jump",))
    one, other = (fit_calibration([path], LINEAR, run).model for path in paths)
    X, q = early["q_des"], early["q_des"]
    assert_allclose(one.correction(X, q), other.correction(X, q), atol=0.0)
