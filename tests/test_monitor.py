import numpy as np
import pytest

from catenary.monitor import EventRate, Snapshot, monitor_lines, plain_line
from catenary.plant import OperatingState
from catenary.sensing.gravity_vector import tilted_gravity

FINE = Snapshot(
    1.0, ("a", "b"), ("rad", "m"), np.array([0.5, 0.1]), np.array([0.5, 0.1]), gravity=np.array([0.0, 0.0, -9.81]),
    gravity_age=0.01, operating=OperatingState("ENABLED", True, False), lower=np.array([0.0, 0.0]),
    upper=np.array([1.0, 0.2]), rate_hz=1000.0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, None),
        ({"gravity_age": np.inf}, None),  # nominal gravity is not stale
        ({"q": np.array([0.99, 0.1])}, "near a limit: a"),
        ({"q": np.array([0.5, 0.197])}, "near a limit: b"),
        ({"gravity_age": 0.5}, "gravity is 0.50 s old"),
        ({"operating": OperatingState("FAULT", True, False)}, "FAULT: it does not say why"),
        ({"operating": OperatingState("FAULT", True, False), "fault": "a cable"}, "FAULT: a cable"),
        ({"operating": OperatingState("DISABLED", False, False)}, "not homed"),
        ({"inside": np.array([True, False])}, "valid range: b"),
        ({"late": 3}, "3 ticks of this program late"),
        ({"silent": "nothing has come for 0.4 s"}, "stale: nothing"),
    ],
)
def test_what_is_wrong_is_said_and_nothing_else(change: dict[str, object], words: str | None) -> None:
    found = FINE._replace(**change).warnings()
    assert len(found) == (words is not None)
    assert all(words in warning for warning in found if words)


def test_rate_is_that_of_the_last_second() -> None:
    rate = EventRate()
    for k in range(200):
        rate.count(0.1 * k if k < 100 else 9.9 + 0.01 * (k - 99))
    assert rate.hertz(9.9 + 0.01 * 100) == pytest.approx(100.0)
    assert rate.hertz(20.0) is None


JOINTS = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")
UNITS = ("rad", "rad", "m", "rad", "rad", "rad", "rad")


def sample(**change: object) -> Snapshot:
    q = np.array([np.pi / 6, np.pi / 2, 0.4, 0.0, 0.1, 0.5, -0.5])
    given = Snapshot(
        12.5, JOINTS, UNITS, q, q, tau=np.zeros(7), gravity_tau=np.array([1.0, 2.0, 3.0]),
        gravity=tilted_gravity(0.1, -0.2), gravity_age=0.02, operating=OperatingState("ENABLED", True, False),
        lower=q - 1.0, upper=q + 1.0, rate_hz=999.7,
    )  # fmt: skip
    return given._replace(**change)


@pytest.mark.parametrize("size", [(80, 24), (30, 8), (200, 50)])
def test_the_picture_has_the_size_of_the_terminal(size: tuple[int, int]) -> None:
    lines = monitor_lines("raven2", sample(late=4), *size)
    assert len(lines) == size[1]
    assert max(map(len, lines)) <= size[0]


def test_seven_joints_with_a_model_fit_into_80_columns() -> None:
    lines = monitor_lines("raven2", sample(calibrated=np.zeros(7), inside=np.ones(7, dtype=bool)))
    assert max(map(len, lines)) <= 80
    assert all(any(joint in line for line in lines) for joint in JOINTS)


def test_half_widths_stand_beside_calibrated_joints_of_a_model_that_has_them() -> None:
    shown = sample(calibrated=np.zeros(7), interval=np.array([np.deg2rad(1.5), *[np.nan] * 6]))
    lines = monitor_lines("raven2", shown, 90)
    assert "calibrated     +/-" in lines[3]
    assert "0.00    1.50" in lines[4]
    assert "0.00       -" in lines[5]
    assert "+/-" not in monitor_lines("raven2", shown._replace(interval=np.full(7, np.nan)), 90)[3]


def test_degrees_millimetres_and_the_tilt_of_the_base_are_shown() -> None:
    text = "\n".join(monitor_lines("raven2", sample()))
    tilt = f"roll {np.rad2deg(0.1):6.2f} pitch {np.rad2deg(-0.2):6.2f}"
    for shown in (" 30.00", "400.00", tilt, "age 20 ms"):
        assert shown in text


def test_a_joint_outside_the_valid_range_is_marked() -> None:
    lines = monitor_lines("raven2", sample(calibrated=np.zeros(7), inside=np.array([False] + [True] * 6)))
    assert "0.00?" in lines[4]
    assert "?" not in lines[5]


def test_only_warnings_are_coloured() -> None:
    lines = monitor_lines("raven2", sample(late=4), colour=True)
    assert [line for line in lines if "\x1b" in line] == ["\x1b[31m! 4 ticks of this program late within 1 s\x1b[0m"]


def test_why_a_robot_is_in_fault_is_not_cut_off() -> None:
    why = "the software e-stop tripped: a motor's command was too large, and the next one larger still"
    lines = monitor_lines("raven2", sample(operating=OperatingState("FAULT", True, False), fault=why))
    assert " ".join(f"! the robot is in FAULT: {why}".split()) in " ".join(" ".join(lines).split())
    assert max(map(len, lines)) <= 80
    assert len(lines) == 24


def test_a_pipe_gets_one_line() -> None:
    line = plain_line(sample(late=4))
    assert "\n" not in line
    assert "shoulder=30.00deg" in line
    assert "4 ticks of this program late" in line


def test_a_line_tells_calibrated_and_measured_joints_where_there_are_any() -> None:
    calibrated = np.array([np.pi / 4, np.pi / 3, 0.41, 0.0, 0.0, 0.0, np.nan])
    line = plain_line(sample(calibrated=calibrated, encoder=calibrated[:3]))
    assert "  calibrated 45.00 60.00 410.00 0.00 0.00 0.00 -" in line
    assert "  measured 45.00 60.00 410.00" in line
    assert "calibrated" not in plain_line(sample(encoder=np.full(3, np.nan)))
    assert "measured" not in plain_line(sample(encoder=np.full(3, np.nan)))
