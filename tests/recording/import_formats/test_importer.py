"""Recordings of other makes, written by other programs' libraries, on one clock.

Angles that were recorded within one turn come out continuous, in the turn of the commands and of the limits.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.recording.logs import Reading, read_recording, read_torque_log
from catenary.robots.catalog import load_robot
from catenary.verdict.corrections import Mend
from catenary.verdict.whole_turns import unwrapped
from catenary.workflows.import_recording import import_recording
from lab_bags import JOINT_STATE, JOINTS, Message, joint_state, true_q, two_topics, write_bag
from lab_tables import TABLES

BY_HAND = ["q_nominal=/raven/joint_cmd.position", "q_encoder=/optitrack/joints.position"]
# a straight line between samples 1/30 s apart is off by at most h^2/8 of the acceleration, 0.7 rad/s2
STRAIGHT = 0.7 / 30**2 / 8 + 1e-9


def test_a_bag_is_brought_onto_one_clock_by_the_joints_names_by_hand_and_as_proposed(tmp_path: Path) -> None:
    bag = two_topics(tmp_path / "lab", "mcap")
    log = import_recording(bag, BY_HAND, units="rad,rad,m")
    assert (log.joint_names, log.joint_units) == (JOINTS, ("rad", "rad", "m"))
    assert_allclose(log.q_nominal, true_q(log.time), atol=1e-9)
    assert log.ok.sum() > 700  # of 1000: the camera sees 8 s of 10
    assert not log.ok[log.time < 0.99].any()  # it starts later
    assert_allclose(log.q_encoder[log.ok], true_q(log.time[log.ok]) + 0.02, atol=STRAIGHT)
    assert any("followed by name" in note for note in log.notes)
    assert any("rows have no q_encoder" in note for note in log.notes)
    proposed = import_recording(bag, accept_proposal=True)
    for key in ("q_nominal", "q_encoder", "ok", "time"):
        assert_allclose(getattr(proposed, key), getattr(log, key))


def test_units_signs_and_parts_of_arrays_turn_numbers_into_si(tmp_path: Path) -> None:
    t = np.arange(0.0, 2.0, 0.01)
    seen = np.column_stack([np.rad2deg(true_q(t)[:, 0]), -np.rad2deg(true_q(t)[:, 1]), 1e3 * true_q(t)[:, 2]])
    messages: list[Message] = [(x, "/cmd", joint_state(JOINTS, true_q(x))) for x in t]
    messages += [(x, "/cam", joint_state((), row)) for x, row in zip(t, seen, strict=True)]
    bag = write_bag(tmp_path / "lab", "mcap", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    options = ["q_nominal=/cmd.position[0:3]@rad,rad,m"]
    options += ["q_encoder=/cam.position[0],-/cam.position[1],/cam.position[2]@deg,deg,mm"]
    log = import_recording(bag, options)
    assert log.ok.all()
    assert_allclose(log.q_encoder, log.q_nominal, atol=1e-12)


def test_motors_positions_speeds_and_torques_become_those_of_the_joints_by_one_coupling(tmp_path: Path) -> None:
    matrix = np.array([[1.0, 0.0, 0.0], [0.2, 1.0, 0.0], [-0.1, 0.3, 0.9]])
    t = np.arange(0.0, 5.0, 0.01)
    q, qd = np.sin(np.outer(t, [1.0, 1.3, 0.7])), np.cos(np.outer(t, [1.0, 1.3, 0.7])) * [1.0, 1.3, 0.7]
    tau = np.cos(np.outer(t, [0.5, 0.3, 1.1]))
    of_motors = np.linalg.inv(matrix)
    table = {"t": t} | {f"m{j}": c for j, c in enumerate((q @ of_motors.T).T)}
    table |= {f"v{j}": c for j, c in enumerate((qd @ of_motors.T).T)} | {
        f"e{j}": c for j, c in enumerate((tau @ matrix).T)
    }
    path = tmp_path / "motors.csv"
    np.savetxt(
        path, np.column_stack([*table.values()]), delimiter=",", header=",".join(table), comments="", fmt="%.17g"
    )
    columns = {"q_nominal": "m", "qd": "v", "tau": "e"}
    mapping = {
        key: {"columns": [f"{letter}{j}" for j in range(3)], "coupling": matrix.tolist()}
        for key, letter in columns.items()
    }
    mapping |= {"joint_units": ["rad"] * 3, "time": ["t"], "time_unit": "s"}
    log = import_recording(path, mapping)
    assert_allclose(log.q_nominal, q, atol=1e-12)
    assert_allclose(log.qd, qd, atol=1e-12)
    assert_allclose(log.tau, tau, atol=1e-12)
    assert_allclose((log.tau * log.qd).sum(axis=1), (tau * qd).sum(axis=1), atol=1e-12)  # power is the motors'
    for wrong, says in (([[1.0, 0.0], [0.0, 1.0]], r"expected \(3, 3\)"), ([[1.0] * 3] * 3, "that has an inverse")):
        spoilt = mapping | {"q_nominal": mapping["q_nominal"] | {"coupling": wrong}}
        with pytest.raises((InputError, ConfigError), match=says):
            import_recording(path, spoilt)


def test_counts_need_a_scale(tmp_path: Path) -> None:
    bag = two_topics(tmp_path / "lab", "ros1")
    with pytest.raises(InputError, match="counts: give the scale"):
        import_recording(
            bag,
            ["q_nominal=/raven/joint_cmd.position[outer_yaw],/raven/joint_cmd.position[outer_pitch]@counts"],
            robot="two_link",
        )
    counted = import_recording(
        bag, ["q_nominal=/raven/joint_cmd.position[outer_yaw],/raven/joint_cmd.position[outer_pitch]@counts*0.5"],
        robot="two_link",
    )  # fmt: skip
    assert_allclose(counted.q_nominal, 0.5 * true_q(counted.time)[:, :2], atol=1e-9)


def test_arrays_that_change_length_leave_rows_without_a_measurement(tmp_path: Path) -> None:
    messages: list[Message] = []
    for i, t in enumerate(np.arange(0.0, 2.0, 0.01)):
        messages.append((t, "/cmd", joint_state(JOINTS, true_q(t), qd=() if i % 4 == 0 else np.ones(3))))
        lost = 50 <= i < 80
        messages.append((t, "/cam", joint_state(JOINTS[: 1 if lost else 3], true_q(t)[: 1 if lost else 3])))
    bag = write_bag(tmp_path / "lab", "sqlite", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    log = import_recording(bag, ["q_nominal=/cmd.position", "q_encoder=/cam.position"], units="rad,rad,m")
    assert not log.ok[(log.time > 0.495) & (log.time < 0.795)].any()
    assert log.ok.sum() == 170
    (said,) = (note for note in log.notes if "have no q_encoder" in note)
    assert said == "30 of 200 rows have no q_encoder (outer_pitch 30, outer_insertion 30)"  # the first was measured
    moving = import_recording(bag, ["q_nominal=/cmd.position", "qd=/cmd.velocity"], units="rad,rad,m")
    assert len(moving) == 150
    assert any("50 of 200 rows without qd were left out" in note for note in moving.notes)


def test_messages_without_stamps_are_taken_at_their_arrival_and_nan_is_no_measurement(tmp_path: Path) -> None:
    messages: list[Message] = []
    for i, t in enumerate(np.arange(0.0, 2.0, 0.01)):
        seen = true_q(t) * (np.nan if i == 100 else 1.0)
        messages.append((t, "/cmd", joint_state(JOINTS, true_q(t), stamped=False)))
        messages.append((t, "/cam", joint_state(JOINTS, seen, stamped=False)))
    bag = write_bag(tmp_path / "lab", "ros1", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    log = import_recording(bag, ["q_nominal=/cmd.position", "q_encoder=/cam.position"], units="rad,rad,m")
    assert any("carry no stamps; their arrival was taken" in note for note in log.notes)
    assert np.flatnonzero(~log.ok).tolist() == [100]
    assert_allclose(log.q_encoder[log.ok], log.q_nominal[log.ok])


@pytest.mark.parametrize("good", [1, 200])  # not 0, as docs have it: a quality, too
def test_what_lies_between_a_good_sample_and_a_bad_one_is_not_trusted(good: int, tmp_path: Path) -> None:
    """A camera at 30 Hz beside a robot at 100 Hz, which writes zeros where it sees nothing."""
    t, s = np.arange(0.0, 10.0, 0.01), np.arange(0.003, 10.0, 0.033)
    seen, valid = true_q(s) + 0.01, np.full(len(s), good)
    seen[100:103], valid[100:103] = 0.0, 0
    robot, camera = tmp_path / "robot.csv", tmp_path / "camera.csv"
    np.savetxt(robot, np.column_stack([t, true_q(t)]), delimiter=",", header="t,q1,q2,q3", comments="")
    np.savetxt(camera, np.column_stack([s, seen, valid]), delimiter=",", header="t,cam1,cam2,cam3,valid", comments="")
    options = ["q_nominal=q1,q2,q3", "q_encoder=cam1,cam2,cam3", "ok=valid"]
    log = import_recording([robot, camera], options, units="rad,rad,m")
    inside = (log.time > s[99]) & (log.time < s[103])
    assert np.array_equal(log.ok, (log.time >= s[0]) & (log.time <= s[-1]) & ~inside)
    assert_allclose(log.q_encoder[log.ok], true_q(log.time[log.ok]) + 0.01, atol=STRAIGHT)
    np.savetxt(robot, np.column_stack([t, true_q(t), t != 5.0]), delimiter=",", header="t,q1,q2,q3,valid", comments="")
    both = import_recording([robot, camera], units="rad,rad,m", accept_proposal=True)
    assert np.flatnonzero(log.ok & ~both.ok).tolist() == [500]


def test_columns_beside_others_without_a_single_number_are_told_as_such(tmp_path: Path) -> None:
    t = np.arange(0.0, 3.0, 0.01)
    np.savetxt(tmp_path / "robot.csv", np.column_stack([t, true_q(t)]), delimiter=",", header="t,q1,q2,q3", comments="")
    rows = [",".join(map(str, [x, *true_q(x), "", ""])) for x in t]
    (tmp_path / "camera.csv").write_text("\n".join(["t,cam1,cam2,cam3,force,valid", *rows]))
    options = ["q_nominal=q1,q2,q3", "q_encoder=cam1,cam2,cam3"]
    for further, said in (
        ("signal:force=force", "no row has all of .*signal force"),
        ("ok=valid", "ok is set on none"),
    ):
        with pytest.raises(InputError, match=said):
            import_recording([tmp_path / "robot.csv", tmp_path / "camera.csv"], [*options, further], units="rad,rad,m")


def test_clocks_that_nobody_set_are_left_for_arrivals(tmp_path: Path) -> None:
    from lab_bags import header

    def by_a_wrong_clock(t: float) -> Message:
        def make(store: object, head: object) -> object:
            made = joint_state(JOINTS, true_q(t))(store, head)
            made.header = header(store, round(t * 1e9) + 10**9, ros1=True)  # 1970
            return made

        return t, "/cam", make

    times = np.arange(0.0, 2.0, 0.01)
    messages: list[Message] = [(t, "/cmd", joint_state(JOINTS, true_q(t))) for t in times]
    messages += [by_a_wrong_clock(t) for t in times]
    bag = write_bag(tmp_path / "lab", "ros1", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    options = ["q_nominal=/cmd.position", "q_encoder=/cam.position"]
    log = import_recording(bag, options, units="rad,rad,m")
    assert log.ok.all()
    assert_allclose(log.q_encoder, log.q_nominal, atol=1e-9)
    assert any("clocks that differ; arrivals were taken" in note for note in log.notes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["q_nominal=/raven/joint_cmd.positions"], r"no column .*joint_cmd has .*position\[0:3\]"),
        (["q_nominal=/raven/joints.position"], "topics are /raven/joint_cmd, /optitrack/joints"),
        (["q_nominal=/raven/joint_cmd.position[elbow]"], "its joints are outer_yaw"),
        (["q_nominal=/raven/joint_cmd.position[0:9]"], "no column"),
        (["q_nominal=/raven/joint_cmd.position", "q_encoder=/optitrack/joints.position[0]"], "1 columns, q_nominal 3"),
        (["q_nominal=/raven/joint_cmd.position@deg,mm"], "2 for 3 columns"),
    ],
)  # fmt: skip
def test_what_is_not_there_is_named_with_what_is(options: list[str], message: str, tmp_path: Path) -> None:
    bag = two_topics(tmp_path / "lab", "ros1", seconds=3.0)
    with pytest.raises(InputError, match=message):
        import_recording(bag, options)


@pytest.mark.parametrize("option", ["q_nominal", "q=a", "signal=a", "q_nominal=a@furlong", "time=t@min"])
def test_options_that_are_no_mapping_are_refused(option: str, tmp_path: Path) -> None:
    bag = two_topics(tmp_path / "lab", "ros1", seconds=3.0)
    with pytest.raises(ConfigError):
        import_recording(bag, ["q_nominal=/raven/joint_cmd.position", option])


def test_a_bag_that_was_cut_off_while_it_was_recorded_is_read(tmp_path: Path) -> None:
    data = two_topics(tmp_path / "lab", "ros1").read_bytes()
    bag = tmp_path / "lab.bag.active"  # rosbag renames it when it is closed
    bag.write_bytes(data[: len(data) * 3 // 4])
    log = import_recording(bag, BY_HAND, units="rad,rad,m")
    assert len(log) > 500
    assert_allclose(log.q_nominal, true_q(log.time), atol=1e-9)


@pytest.mark.parametrize("encoding", ["json", "protobuf"])
def test_mcap_in_other_encodings_is_called_what_it_is(tmp_path: Path, encoding: str) -> None:
    with (tmp_path / "lab.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/joints", encoding, writer.register_schema("lab.Joints", encoding, b"{}"))
        writer.add_message(channel, 0, b'{"q": [0.1]}', 0)
        writer.finish()
    with pytest.raises(FileFormatError, match=f"/joints is in {encoding}, which is left out; .*PlotJuggler exports"):
        import_recording(tmp_path / "lab.mcap", BY_HAND)


def roll(t: Floats) -> Floats:
    """Two joints [rad]: a roll that goes three turns out and back, and an elbow."""
    return np.column_stack([3.0 + 9.0 * np.sin(0.4 * t), 0.5 * np.sin(t)])


def within_a_turn(q: Floats) -> Floats:
    return np.asarray((q + np.pi) % (2.0 * np.pi) - np.pi)


@given(start=st.floats(-3.0, 3.0), speed=st.floats(-15.0, 15.0), rate=st.sampled_from([30.0, 100.0]))
def test_what_moves_slower_than_a_tenth_of_a_turn_a_row_is_brought_back(
    start: float, speed: float, rate: float
) -> None:
    q = start + speed * np.sin(np.arange(0.0, 4.0, 1.0 / rate))
    found, jumps = unwrapped(within_a_turn(q), 2.0 * np.pi)
    off = found - q
    assert_allclose(off, off[0], atol=1e-9)
    # jumps are counted where the joint leaves its turn
    assert jumps == np.count_nonzero(np.diff(np.floor((q + np.pi) / (2.0 * np.pi))))


def test_random_poses_are_left_as_they_are() -> None:
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, 2000)
    assert_array_equal(unwrapped(q, 2.0 * np.pi)[0], q)


def test_a_camera_that_counts_within_a_turn_is_interpolated_and_follows_the_motor(tmp_path: Path) -> None:
    messages: list[Message] = [
        (t, "/cmd", joint_state(("roll", "elbow"), roll(np.array([t]))[0])) for t in np.arange(0.0, 8.0, 0.01)
    ]
    messages += [
        (t, "/cam", joint_state(("roll", "elbow"), within_a_turn(roll(np.array([t])))[0]))
        for t in np.arange(0.0, 8.0, 1 / 30)
    ]
    bag = write_bag(tmp_path / "lab", "mcap", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    log = import_recording(bag, ["q_nominal=/cmd.position@rad", "q_encoder=/cam.position@rad"])
    # a straight line between samples 1/30 s apart is off by at most h^2/8 of the acceleration, 9 * 0.16 rad/s2
    assert_allclose(log.q_encoder[log.ok], log.q_nominal[log.ok], atol=9 * 0.16 / 30**2 / 8 + 1e-9)
    assert any("q_encoder of roll: jumps by a turn" in note for note in log.notes)
    assert not any("elbow" in note for note in log.notes)


def test_degrees_are_turns_of_360_and_both_may_wrap(tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.02)
    q = roll(t)
    q[:, 0] = 3.0 + 0.6 * np.sin(t)  # about pi
    seen = q + np.array([0.4, 0.01])
    table = np.column_stack([t, np.rad2deg(within_a_turn(q)), np.rad2deg(within_a_turn(seen))])
    header = "t,roll,elbow,cam_roll,cam_elbow"
    np.savetxt(tmp_path / "lab.csv", table, delimiter=",", header=header, comments="")
    log = import_recording(tmp_path / "lab.csv", ["q_nominal=roll,elbow", "q_encoder=cam_roll,cam_elbow"], units="deg")
    assert_allclose(log.q_nominal, q, atol=1e-9)
    assert_allclose(log.q_encoder, seen, atol=1e-9)


def test_a_joint_whose_limits_are_known_comes_out_within_them(tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.02)
    q = 2.9 + 0.6 * np.cos(t)  # a Panda's sixth joint reaches from 0 to 3.75; the first row is beyond pi
    table = np.column_stack([t, within_a_turn(q), within_a_turn(q + 0.01)])
    np.savetxt(tmp_path / "lab.csv", table, delimiter=",", header="t,q6,cam", comments="")
    mapping = {"robot": "panda", "joint_names": ["q6"], "q_nominal": {"columns": "q6"}, "q_encoder": {"columns": "cam"}}
    log = import_recording(tmp_path / "lab.csv", mapping)
    assert_allclose(log.q_nominal[:, 0], q, atol=1e-9)
    assert_allclose(log.q_encoder[:, 0], q + 0.01, atol=1e-9)
    assert any("q6: brought within the robot's limits by +1 turn(s)" in note for note in log.notes)


# Kinova's Gen3, whose joints Kortex reports within 0 to 360 deg
_SECONDS = np.arange(0.0, 20.0, 0.01)
TURNING = np.column_stack([np.sin((0.3 + 0.1 * i) * _SECONDS + i) for i in range(7)])  # [rad] across zero
GEN3, DEGREES = [f"q{i}" for i in range(1, 8)], ",".join(["deg"] * 7)


def kortex() -> Floats:
    return np.degrees(TURNING) % 360.0


@pytest.mark.parametrize("container", TABLES)
def test_joints_within_0_and_360_deg_are_made_continuous_in_every_container(container: str, tmp_path: Path) -> None:
    columns = {"time": _SECONDS} | dict(zip(GEN3, kortex().T, strict=True))
    path = TABLES[container](tmp_path / "gen3", columns)
    log = import_recording(path, [f"q_nominal={','.join(GEN3)}"], units="deg", robot="gen3")
    turns = np.round((log.q_nominal - TURNING) / (2.0 * np.pi))
    assert_allclose(log.q_nominal - TURNING, 2.0 * np.pi * turns[:1].repeat(len(turns), axis=0), atol=1e-9)
    assert not turns[:, [1, 3, 5]].any()  # within the limits of the joints that have some


@pytest.mark.parametrize("way", ["import", "mend"])
@pytest.mark.parametrize("arrays", [{"q": 0.0, "tau": 0.0}, {"q_des": 0.0, "q_act": 0.2, "ok": None}])
def test_a_known_layout_in_degrees_is_read_as_any_table_in_degrees(
    arrays: dict[str, float | None], way: str, tmp_path: Path
) -> None:
    """By `--units`, of an import, or of check, fit and identify, which mend a recording that they read."""
    content = {
        key: np.ones(len(TURNING), dtype=bool) if off is None else (kortex() + off) % 360.0
        for key, off in arrays.items()
    }
    np.savez(tmp_path / "gen3.npz", t=_SECONDS, **content)
    path, mended, model = tmp_path / "gen3.npz", Reading(mend=Mend(units=(DEGREES,))), load_robot("gen3")
    if way == "import":
        log = import_recording(path, units="deg", robot="gen3")
    elif "tau" in arrays:
        log = read_torque_log(path, model, mended)
    else:
        log = read_recording(path, replace(mended, units=("rad",) * 7, joint_names=model.joint_names))
    assert_allclose(np.diff(log.q_nominal, axis=0), np.diff(TURNING, axis=0), atol=1e-9)
    if log.q_encoder is not None:
        assert_allclose(log.q_encoder - log.q_nominal, np.radians(0.2), atol=1e-9)
    elif way == "import":
        assert_allclose(log.q_nominal[:, [1, 3, 5]], TURNING[:, [1, 3, 5]], atol=1e-9)  # within the joints' limits
