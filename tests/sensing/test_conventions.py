"""Units and axes of drivers, each held to what it must read on a level base that rolls to the left."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.recording.import_formats import recording_files
from catenary.recording.import_formats.imu_recording import read_imu
from catenary.sensing.gravity_vector import _DRIVERS, Kind, Mailbox, axes_matrix, convention_of
from catenary.workflows.check import check_file

G = 9.80665
DEG = 180.0 / np.pi
# what each writes, by its manual, of +g up and 0.5 rad/s about the axis that points forward
WRITTEN = {
    "xsens": [0.0, 0.0, G, 0.5, 0.0, 0.0], "microstrain": [0.0, 0.0, -1.0, 0.5, 0.0, 0.0],
    "vectornav": [0.0, 0.0, -G, 0.5, 0.0, 0.0], "bno055": [0.0, 0.0, G, 0.5 * DEG, 0.0, 0.0],
    "mpu6050": [0.0, 0.0, 1.0, 0.5 * DEG, 0.0, 0.0], "livox": [0.0, 0.0, 1.0, 0.5, 0.0, 0.0],
    "realsense": [0.0, -G, 0.0, 0.0, 0.0, 0.5], "zed": [0.0, -G, 0.0, 0.0, 0.0, 0.5 * DEG],
    "x-io": [0.0, 0.0, 1.0, 0.5 * DEG, 0.0, 0.0],
}  # fmt: skip


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, Floats], Path]:
    """Write the columns of a header, rows (N, n), as a file."""

    def as_csv(header: str, rows: Floats) -> Path:
        np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=header, comments="")
        return tmp_path / "a.csv"

    return as_csv


@pytest.mark.parametrize("name", _DRIVERS)
def test_files_and_samples_of_a_driver_come_out_in_si_and_base_axes(
    name: str, write: Callable[[str, Floats], Path]
) -> None:
    first, said = _DRIVERS[name].columns or "ax, gx", WRITTEN[name]
    header = [column.replace("X", axis).replace("gx", f"g{axis.lower()}").replace("ax", f"a{axis.lower()}")
              for column in first.split(", ") for axis in "XYZ"]  # fmt: skip
    path = write(",".join(["time", *header]), np.c_[0.01 * np.arange(30), np.tile(said, (30, 1))])
    told = convention_of(driver=name)
    found, mailbox = read_imu(path, matrices=told, has_units=True), Mailbox(convention=told)
    assert found.rate is not None
    mailbox.put(0.0, said[:3], Kind.SPECIFIC_FORCE)
    mailbox.put(0.0, said[3:], Kind.ANGULAR_RATE)
    (_, force, _), (_, rate, _) = iter(mailbox.take, None)
    assert_allclose([found.force[0], force], np.tile([0.0, 0.0, G], (2, 1)), atol=1e-9)
    assert_allclose([found.rate[0], rate], np.tile([0.5, 0.0, 0.0], (2, 1)), atol=1e-9)


def test_every_driver_is_documented_with_its_units_and_axes() -> None:
    lines = Path("docs/gravity-vector.md").read_text().splitlines()
    for name, driver in _DRIVERS.items():
        row = next(line for line in lines if line.startswith(f"| `{name}`"))
        assert all(f"| {word} |" in row for word in (*driver.units, driver.axes)), name


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("x,-y,-z", np.diag([1.0, -1.0, -1.0])),
        ("NED", np.diag([1.0, -1.0, -1.0])),
        ("y,-x,z", [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    ],
)
def test_axes_are_frames_or_an_order(said: str, expected: np.ndarray) -> None:
    assert_allclose(axes_matrix(said), expected)


def test_a_gyroscope_may_have_axes_of_its_own() -> None:
    told = convention_of(axes=("x,y,z", "-x,-y,-z"))
    assert_allclose(told.force, np.eye(3))
    assert_allclose(told.rate, -np.eye(3))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"units": ("kg",)}, 'unit "kg" of the accelerometer: expected one of m/s2'),
        ({"units": ("g", "rpm")}, 'unit "rpm" of the gyroscope'),
        ({"axes": ("x,x,z",)}, "expected flu, frd"),
        ({"axes": ("-x,y,z",)}, "left-handed"),
        ({"driver": "acme"}, "expected one of xsens"),
    ],
)
def test_conventions_that_there_are_not_are_refused(options: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        convention_of(**options)


@pytest.mark.parametrize(
    ("header", "force", "rate"),
    [
        ("Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s)", G, np.pi / 180),
        ("accel_x_mg,accel_y_mg,accel_z_mg,gyro_x_dps,gyro_y_dps,gyro_z_dps", G / 1000, np.pi / 180),
        ("ax [m/s^2],ay [m/s^2],az [m/s^2],wx [rad/s],wy [rad/s],wz [rad/s]", 1.0, 1.0),
    ],
)  # fmt: skip
def test_units_in_headers_count(header: str, force: float, rate: float, write: Callable[[str, Floats], Path]) -> None:
    rows = np.c_[0.01 * np.arange(30), np.tile([0.0, 0.0, 1.0, 1.0, 0.0, 0.0], (30, 1))]
    found = read_imu(write(f"time,{header}", rows))
    assert_allclose(found.force[0], [0.0, 0.0, force])
    assert found.rate is not None
    assert_allclose(found.rate[0], [rate, 0.0, 0.0])


def test_rows_of_other_sensors_are_no_readings_and_one_that_is_no_number_is_a_fault_of_the_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As PlotJuggler writes several topics: a row for each message, what is not in it left open."""
    rows = [f"{0.01 * i:.2f},0.1,0.2,9.8," if i % 2 else f"{0.01 * i:.2f},,,,0.5" for i in range(40)]
    (tmp_path / "a.csv").write_text("\n".join(["t,ax,ay,az,q1", *rows]) + "\n")
    found = read_imu(tmp_path / "a.csv")
    assert_allclose(found.force, np.tile([0.1, 0.2, 9.8], (20, 1)))
    assert "20 rows have no reading" in found.notes[0]
    with monkeypatch.context() as long:  # a text that is not held whole, of which only the first rows are looked at
        long.setattr(recording_files, "_LONG_FILE_BYTES", 100)
        long.setattr("catenary.recording.import_formats.csv_files._SAMPLED_NUMBERS", 50)
        long.setattr("catenary.recording.import_formats.csv_files._BLOCK_BYTES", 200)
        assert_allclose(read_imu(tmp_path / "a.csv").time, found.time)
    assert check_file(str(tmp_path / "a.csv")).facts["mean_force"] == pytest.approx([0.1, 0.2, 9.8])
    rows[1] = "0.01,0.1,,9.8,"
    (tmp_path / "a.csv").write_text("\n".join(["t,ax,ay,az,q1", *rows]) + "\n")
    assert check_file(str(tmp_path / "a.csv")).faults == ["1 of 20 accelerometer readings are not numbers"]


def test_gravity_that_was_taken_away_and_units_that_there_are_not_are_refused(
    write: Callable[[str, Floats], Path],
) -> None:
    for header, said in (
        ("FreeAcc_X,FreeAcc_Y,FreeAcc_Z", "without gravity"),
        ("ax (lb),ay (lb),az (lb)", 'unit "lb"'),
    ):
        path = write(f"time_s,{header}", np.c_[np.arange(20.0), np.ones((20, 3))])
        with pytest.raises(InputError, match=said):
            read_imu(path)


def test_bursts_are_spread_and_their_time_may_be_told(write: Callable[[str, Floats], Path]) -> None:
    stamps = np.repeat(0.04 * np.arange(1, 20), 4) + np.tile(1e-4 * np.arange(4), 19)
    path = write("time,ax,ay,az", np.c_[stamps, np.tile([0.0, 0.0, 9.8], (76, 1))])
    with pytest.raises(InputError, match="--time time@UNIT") as refused:
        read_imu(path)
    assert "--map" not in str(refused.value)  # which is import's
    found = read_imu(path, time="time@s")
    assert_allclose(np.diff(found.time)[4:], 0.01, atol=1e-6)
    assert any("bursts of 4" in note for note in found.notes)
