import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import TransportError
from catenary.plant import OperatingState
from catenary.robots.catalog import load_robot
from catenary.teleop.session import _JOINT_SPEED, KEY_TIMEOUT_S, RAMP_S, TeleopMotion, TeleopSession
from catenary.teleop.terminal import _SEQUENCE_WITHIN_S, KeyReader
from oracles.ideal_plant import IdealPlant

START = [0.8, 1.5, 0.4]


class TypedTerminal:
    """Gives bytes at ticks; keeps what was drawn."""

    def __init__(self, typed: dict[int, bytes], size: tuple[int, int] = (80, 24)) -> None:
        self.typed, self.size, self.ended, self.wants_suspension = typed, size, None, False
        self.ticks, self.drawn, self.suspended = 0, [], 0

    def read(self) -> bytes:
        self.ticks += 1
        if self.ticks > 5000:
            self.ended = "over"
        return self.typed.get(self.ticks, b"")

    def draw(self, lines: list[str]) -> None:
        self.drawn.append(lines)

    def suspend(self) -> None:
        self.wants_suspension = False
        self.suspended += 1


def raven(**options: object) -> IdealPlant:
    model = load_robot("raven2")
    return IdealPlant(
        START, joint_names=model.joint_names, joint_units=model.joint_units, lower=model.lower, upper=model.upper,
        **options,
    )  # fmt: skip


def run(plant: IdealPlant, typed: dict[int, bytes], size: tuple[int, int] = (80, 24)) -> tuple[str, TypedTerminal]:
    terminal = TypedTerminal(typed, size)
    session = TeleopSession(plant, load_robot("raven2"), "raven2", terminal)
    return session.run(lambda: 0.001 * terminal.ticks), terminal


def test_a_key_moves_its_joint_and_q_pauses_the_robot() -> None:
    plant = raven()
    why, _ = run(plant, {10: b"q", 40: b"q", 70: b"q", 600: b"Q"})
    assert why == "quit"
    assert plant.measured_js().q[0] > START[0]
    assert plant.operating_state().state == "PAUSED"


def test_space_stops_at_once() -> None:
    plant = raven()
    run(plant, {10: b"q", 100: b" ", 400: b"Q"})
    moved = np.flatnonzero(np.diff(np.array(plant.setpoints)[:, 0]))
    assert moved[-1] < 100


def test_the_end_of_the_terminal_holds_and_pauses_the_robot() -> None:
    plant = raven()
    why, _ = run(plant, {})
    assert why == "over"
    assert plant.operating_state().state == "PAUSED"


@pytest.mark.parametrize("size", [(80, 24), (40, 10), (200, 60)])
def test_the_picture_fits_the_terminal(size: tuple[int, int]) -> None:
    _, terminal = run(raven(), {100: b"?", 200: b"Q"}, size)
    for lines in terminal.drawn:
        assert len(lines) == size[1]
        assert max(map(len, lines)) <= size[0]


def test_a_silent_robot_is_told_of_and_teleop_goes_on() -> None:
    class Silent(IdealPlant):
        def measured_js(self):
            if 100 < self.ticks < 300:
                raise TransportError("nothing has come from the robot")
            return super().measured_js()

    model = load_robot("raven2")
    plant = Silent(START, joint_names=model.joint_names, joint_units=model.joint_units)
    why, terminal = run(plant, {600: b"Q"})
    assert why == "quit"
    assert any("nothing has come" in line for lines in terminal.drawn for line in lines)


def test_why_a_robot_is_in_fault_is_shown_whole_also_where_it_is_heard_later() -> None:
    why = "the software e-stop tripped: a motor's command was too large, and the next one larger still"

    class Faulty(IdealPlant):
        fault_reason = ""

        def wait(self):
            super().wait()
            if self.ticks == 100:
                self.state = OperatingState("FAULT", True, False)
            if self.ticks == 200:
                self.fault_reason = why

    model = load_robot("raven2")
    _, terminal = run(Faulty(START, joint_names=model.joint_names, joint_units=model.joint_units), {600: b"Q"})
    shown = " ".join(" ".join(terminal.drawn[-1]).split())
    assert f"the robot is FAULT ({why}), homed" in shown


def test_ctrl_z_holds_the_robot_before_the_process_stops() -> None:
    plant, terminal = raven(), TypedTerminal({10: b"q", 300: b"Q"})
    session = TeleopSession(plant, load_robot("raven2"), "raven2", terminal)
    terminal.wants_suspension = True
    session.run(lambda: 0.001 * terminal.ticks)
    assert terminal.suspended == 1


SENT = {"up": b"\x1b[A", "down": b"\x1bOB", "page up": b"\x1b[5~", "q": b"q", "H": b"H", "ö": "ö".encode(), " ": b" "}


@given(st.lists(st.sampled_from(sorted(SENT)), max_size=20), st.data())
def test_keys_are_the_same_however_the_bytes_are_split(keys: list[str], data: st.DataObject) -> None:
    sent = b"".join(SENT[key] for key in keys)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=5)))
    reader, found = KeyReader(), []
    for first, last in zip([0, *cuts], [*cuts, len(sent)], strict=True):
        if sent[first:last]:
            found += reader.feed(sent[first:last], now=0.0)
    assert found == keys


@given(st.binary(max_size=40))
def test_no_bytes_are_too_strange(data: bytes) -> None:
    reader = KeyReader()
    assert all(key.isprintable() for key in reader.feed(data, 0.0) + reader.feed(b"", 2.0 * _SEQUENCE_WITHIN_S))
    assert reader.feed(b"q", 3.0 * _SEQUENCE_WITHIN_S) == ["q"]


def test_letters_of_other_keys_sequences_move_nothing() -> None:
    assert KeyReader().feed(b"\x1b[15~\x1b[1;5C\x1bq\x1b[200~", 0.0) == []


def test_a_lone_escape_is_a_key_once_nothing_follows() -> None:
    reader = KeyReader()
    assert reader.feed(b"\x1b", 0.0) == []
    assert reader.feed(b"", 0.5 * _SEQUENCE_WITHIN_S) == []
    assert reader.feed(b"", 2.0 * _SEQUENCE_WITHIN_S) == ["escape"]


TICK = 0.001
RAVEN = load_robot("raven2")
AT = np.array([0.8, 1.5, 0.4])


def raven_motion() -> TeleopMotion:
    return TeleopMotion(RAVEN, RAVEN)


def held(motion: TeleopMotion, key: str, seconds: float, q: np.ndarray, after: float = 0.0) -> np.ndarray:
    """Where the robot is, tick by tick, with a key that repeats every 30 ms for so long."""
    path = [np.array(q)]
    for tick in range(round((seconds + after) / TICK)):
        now = tick * TICK
        if now < seconds and tick % 30 == 0:
            motion.press(key, now)
        goal = motion.step(path[-1], now, TICK)[0]
        path.append(path[-1] if goal is None else goal)
    return np.array(path)


def test_motion_stops_a_quarter_of_a_second_after_the_last_repeat() -> None:
    path = held(raven_motion(), "q", 1.0, AT, after=1.0)
    moving = np.flatnonzero(np.diff(path[:, 0]))
    assert moving[-1] * TICK <= 1.0 + KEY_TIMEOUT_S + RAMP_S + TICK


def test_a_held_key_reaches_its_speed_and_moves_its_joint_alone() -> None:
    motion = raven_motion()
    path = held(motion, "s", 1.0, AT)
    assert_allclose(np.diff(path[-100:, 1]), -motion.speed * _JOINT_SPEED["rad"] * TICK)
    assert_allclose(path[:, [0, 2]], np.tile(AT[[0, 2]], (len(path), 1)))


def test_speed_never_leaps() -> None:
    path = held(raven_motion(), "q", 0.5, AT, after=0.5)
    most = raven_motion().speed * _JOINT_SPEED["rad"] * TICK / RAMP_S * TICK
    assert np.abs(np.diff(path[:, 0], n=2)).max() <= most * (1.0 + 1e-6)


@pytest.mark.parametrize(("key", "axis", "sign"), [("up", 0, 1), ("right", 1, -1), ("page up", 2, 1)])
def test_the_tip_moves_straight_along_its_axis(key: str, axis: int, sign: int) -> None:
    path = held(raven_motion(), key, 1.0, AT)
    way = forward_kinematics(RAVEN, path[-1]).position - forward_kinematics(RAVEN, path[0]).position
    assert way[axis] * sign > 0.001
    off = np.delete(way, axis)
    assert np.abs(off).max() < 0.02 * abs(way[axis])  # what the damping of the inverse takes


def test_a_limit_is_reached_reported_and_never_passed() -> None:
    motion = raven_motion()
    q = np.array([RAVEN.upper[0] - 0.001, 1.5, 0.4])
    path = held(motion, "q", 1.0, q)
    assert_allclose(path[-1, 0], RAVEN.upper[0])
    motion.press("q", 1.0)
    assert motion.step(path[-1], 1.0, TICK)[1] == ("shoulder",)


def test_a_joint_beyond_its_limit_may_only_come_back() -> None:
    q = np.array([RAVEN.upper[0] + 0.1, 1.5, 0.4])
    assert_allclose(held(raven_motion(), "q", 0.5, q)[-1], q)
    assert held(raven_motion(), "a", 0.5, q)[-1, 0] < q[0]


def test_opposite_keys_cancel() -> None:
    motion = raven_motion()
    motion.press("q", 0.0)
    motion.press("a", 0.0)
    assert_allclose(motion.step(AT, 0.0, TICK)[0], AT)


def test_keys_of_joints_that_there_are_not_move_nothing() -> None:
    motion = raven_motion()
    assert not motion.press("r", 0.0)
    assert motion.step(AT, 0.0, TICK)[0] is None
