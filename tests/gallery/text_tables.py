"""Tables of text: with a line of names or without, from NumPy, MATLAB, ROS, spreadsheets and loggers."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from . import QD, SEEN, TAU, Q, Sample, T

ALL = np.column_stack([T, Q, QD, TAU])
NAMES = ("yaw", "pitch", "insertion")
DEG = np.array([180 / np.pi, 180 / np.pi, 1000.0])
BEGIN = 1_700_000_000  # [s]
MOVED = {"q_nominal": Q, "qd": QD, "tau": TAU, "time": T}
PAIR = {"q_nominal": Q, "q_encoder": SEEN, "time": T}
WHICH = {"q_nominal": "data[1]"}


def savetxt(columns: Sequence[np.ndarray], **how: object) -> Callable[[Path], object]:
    """Return what writes columns as np.savetxt does."""
    how = {"fmt": "%.9g", "comments": "# "} | how
    return lambda path: np.savetxt(path, np.column_stack(columns), **how)


def named(header: str, *columns: np.ndarray, **how: object) -> Callable[[Path], object]:
    """Return what writes columns below their names, between commas."""
    return savetxt(columns, delimiter=",", comments="", header=header, **how)


def lines(head: str, rows: Callable[[int], str], end: str = "\n") -> Callable[[Path], object]:
    """Return what writes a head and a line for each row."""
    return lambda path: path.write_text(head + "\n".join(map(rows, range(len(T)))) + end, newline="")


def cells(values: np.ndarray, separator: str = ",", decimal: str = ".") -> str:
    """Return a row."""
    return separator.join(f"{v:.9g}".replace(".", decimal) for v in values)


def ascii_matlab(path: Path) -> object:
    """Write as MATLAB's `save -ascii -double`: each number in 25 characters."""
    return path.write_text("".join("".join(f"{v:25.16e}" for v in row) + "\n" for row in ALL))


def dated(form: str) -> Callable[[int], str]:
    """Return rows that begin with the date as strftime writes it, the last six digits being microseconds."""
    begin = datetime(2026, 3, 29, 23, 59, 58, tzinfo=UTC)  # over midnight
    return lambda i: f"{(begin + timedelta(seconds=T[i])).strftime(form)},{cells(Q[i])}"


def noisy_drive(path: Path) -> object:
    """Write the log of a drive: counts of 1e-4, velocities filtered and late, one joint at rest, torques last."""
    rng = np.random.default_rng(0)
    q = np.round(Q / 1e-4) * 1e-4
    qd = lfilter([0.3], [1.0, -0.7], QD, axis=0) + 0.002 * rng.standard_normal(QD.shape)
    q[:, 1], qd[:, 1] = 1.1 + 1e-5 * rng.standard_normal(len(T)), 1e-4 * rng.standard_normal(len(T))
    return np.savetxt(path, np.column_stack([T, q, qd, TAU + 0.1 * rng.standard_normal(TAU.shape)]), delimiter=",")


def two_arms(i: int) -> str:
    """Return a row of `ros2 topic echo --csv` of two PSMs in one JointState, the second first."""
    names = [f"PSM{arm}_{joint}" for arm in (2, 1) for joint in NAMES]
    return f"{BEGIN + i // 100},{i % 100 * 10**7},,{','.join(names)},{cells([*SEEN[i], *Q[i], *QD[i], *QD[i], *TAU[i], *TAU[i]])}"


def in_brackets(values: np.ndarray) -> str:
    """Return a row as an array in one cell, as Python prints lists."""
    return f'"[{", ".join(f"{v:.9g}" for v in values)}]"'


PLAIN_NAMES = "t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3"
BY_NUMBER = "columns by number; dq is the derivative of q, tau is what is left"
TOLD = ("data[4] ... data[6] are the derivatives of data[1] ... data[3]", "data[7] ... data[9] are what is left")
JOINT_STATE = [f"field.{a}{j}" for a in ("position", "velocity", "effort") for j in range(3)]

SAMPLES = [
    Sample("`np.savetxt`", "savetxt.txt", BY_NUMBER, savetxt([ALL]), says=TOLD, truth=MOVED),
    Sample("MATLAB `csvwrite`", "csvwrite.csv", "likewise", savetxt([ALL], delimiter=","), says=TOLD, truth=MOVED),
    Sample("MATLAB `save -ascii`", "ascii.dat", "likewise", ascii_matlab, says=TOLD, truth=MOVED),
    Sample(
        "a C logger (tabs, stamps in ns)", "log.tsv", "likewise",
        lines("", lambda i: f"{BEGIN * 10**9 + i * 10**7}\t{cells(ALL[i, 1:], chr(9))}\t"), says=TOLD, truth=MOVED,
    ),
    Sample(
        "a C logger (semicolons, decimal commas)", "log.txt", "likewise",
        lines("", lambda i: cells(ALL[i], ";", ",")), says=TOLD, truth=MOVED,
    ),
    Sample(
        "a logger without time", "states.csv", "columns by number, recognised as before; rows without time",
        savetxt([Q, QD, TAU], delimiter=","), says=("no column is the time", "data[6] ... data[8] are what is left"),
        truth={"q_nominal": Q, "qd": QD, "tau": TAU},
    ),
    Sample(
        "a logger, joint by joint", "interleaved.csv", "columns by number; each velocity after its position",
        savetxt([T, *(c for j in range(3) for c in (Q[:, j], QD[:, j]))], delimiter=","),
        says=('columns = ["data[1]", "data[3]", "data[5]"]',), truth={"q_nominal": Q, "qd": QD},
    ),
    Sample(
        "a drive's log (filtered velocities, a joint at rest)", "drive.csv", BY_NUMBER, noisy_drive, says=TOLD,
        units="rad,rad,m", truth={"time": T},
    ),
    Sample(
        "a calibration script", "pairs.csv", "columns by number; which half was measured is asked",
        savetxt([T, Q, SEEN], delimiter=","), asks=WHICH, truth=PAIR,
    ),
    Sample(
        "`np.savetxt(header=)`", "header.txt", "names in the comment",
        savetxt([ALL], header=PLAIN_NAMES.replace(",", " ")), truth=MOVED,
    ),
    Sample(
        "`np.savetxt(header=)`, other separators", "commas.txt", "names in the last of several comments",
        savetxt([ALL], header=f"robot: dVRK, PSM1\nrate 100 Hz\n{PLAIN_NAMES}"), truth=MOVED,
    ),
    Sample(
        "Octave, MATLAB `fprintf`", "octave.txt", "names in the last comment, %",
        lines("% Created by Octave\n%\n% t\tq1\tq2\tq3\n", lambda i: cells(ALL[i, :4], "\t")),
    ),
    Sample(
        "a C++ logger", "cpp.csv", "names in the last comment, //; comments among the rows",
        lines("// run 7\n// t;q1;q2;q3\n", lambda i: cells(ALL[i, :4], ";") + "\n// still;alive;after;300" * (i == 300)),
        says=("1 comment lines among the rows were passed over",),
    ),
    Sample(
        "LabVIEW, DAQ programs", "units.csv", "a line of units after the names",
        lines("time,yaw,pitch,insertion\n[ms],[deg],[deg],[mm]\n",
              lambda i: cells([1e3 * T[i], *(DEG * Q[i])])),
        says=('columns = ["yaw [deg]", "pitch [deg]", "insertion [mm]"]',), units=None,
    ),
    Sample(
        "Panda loggers", "short.csv", "2 names for 10 columns are said, and not taken",
        lines("time,data\n", lambda i: cells(ALL[i])), says=("2 names for 10 columns (time, data, ...)", *TOLD),
        truth=MOVED,
    ),
    Sample(
        "merged cells of a spreadsheet", "merged.csv", "merged heads are said, and not taken",
        lines("time,joint positions,joint velocities,torques\n", lambda i: cells(ALL[i])),
        says=("4 names for 10 columns", *TOLD), truth=MOVED,
    ),
    Sample(
        "a head over blocks", "blocks.csv", "each name reaches to the next",
        lines("time,joint positions,,,joint effort,,,cartesian positions,,\n",
              lambda i: cells(np.concatenate([ALL[i, [0, 1, 2, 3, 7, 8, 9]], Q[i]]))),
        says=('"joint effort[2]"',), truth={"q_nominal": Q, "tau": TAU, "time": T},
    ),
    Sample(
        "libfranka loggers", "franka.csv", "q_d is what was commanded",
        lines(",".join(["time", *(f"{a}_{j}" for a in ("q", "q_d", "dq", "tau_J", "tau_J_d") for j in range(3))]) + "\n",
              lambda i: cells(np.concatenate([[T[i]], Q[i], SEEN[i], QD[i], TAU[i], 2 * TAU[i]]))), truth=MOVED,
    ),
    Sample(
        "scripts of a dVRK lab", "current.csv", "\"current\" is now; errors are no joints",
        lines("time,current joint position 1,current joint position 2,current joint position 3,marker_reg_error\n",
              lambda i: cells([*ALL[i, :4], 1e-4 * Q[i, 0]])), truth={"q_nominal": Q, "time": T},
    ),
    Sample(
        "pandas, of an array", "pandas.csv", "0, 1, 2, ... above the columns are no row",
        lines(f",{','.join(map(str, range(10)))}\n", lambda i: f"{i},{cells(ALL[i])}"),
        asks={"time_unit": "s"}, truth={"q_nominal": Q},
    ),
    Sample(
        "`rostopic echo -p`", "echo.csv", "names; the header's stamp is the time",
        lines(f"%time,field.header.seq,field.header.stamp,{','.join(JOINT_STATE)}\n",
              lambda i: f"{BEGIN * 10**9 + i * 10**7 + 7_000_000},{i},{BEGIN * 10**9 + i * 10**7},{cells(ALL[i, 1:])}"),
        truth=MOVED,
    ),
    Sample(
        "`ros2 topic echo --csv`, JointState", "echo2.csv", "joints by the names in each row; seconds and nanoseconds",
        lines("", lambda i: f"{BEGIN + i // 100},{i % 100 * 10**7},,{','.join(NAMES)},{cells(ALL[i, 1:])}"),
        says=("ros2 topic echo --csv", '"position[insertion]"'), truth=MOVED,
    ),
    Sample(
        "`ros2 topic echo --csv`, other types", "echo3.csv", "columns by number after the stamp",
        lines("", lambda i: f"{BEGIN + i // 100},{i % 100 * 10**7},base,{cells(ALL[i, 1:])}"),
        says=("ros2 topic echo --csv", "are the derivatives"), truth=MOVED,
    ),
    Sample(
        "`ros2 topic echo --csv`, two arms", "arms.csv", "which arm is asked",
        lines("", two_arms), asks={"q_nominal": "PSM1"}, says=('"position[PSM1_yaw]"',), truth=MOVED,
    ),
    Sample(
        "pandas, lists in cells", "lists.csv", "arrays",
        lines("time,joint_positions,joint_torques\n", lambda i: f"{T[i]},{in_brackets(Q[i])},{in_brackets(TAU[i])}"),
        truth={"q_nominal": Q, "tau": TAU, "time": T},
    ),
    Sample(
        "UR's RTDE", "rtde.csv", "target_moment is tau",
        lines(" ".join(["timestamp", *(f"{a}_{j}" for a in ("target_q", "target_qd", "target_moment", "actual_q",
                                                            "actual_current") for j in range(3))]) + "\n",
              lambda i: cells([T[i], *SEEN[i], *QD[i], *TAU[i], *Q[i], *(0.1 * TAU[i])], " ")),
        asks={"q_encoder": "none"}, truth=MOVED | {"qd": QD},
    ),
    Sample(
        "a dVRK's raw readings", "raw.csv", "potentiometers are asked",
        lines("timestamp," + ",".join(f"{a}{j}" for a in ("encoder", "potentiometer") for j in range(3)) + "\n",
              lambda i: cells([T[i], *Q[i], *SEEN[i]])),
        asks={"q_encoder": "potentiometer0"}, truth=PAIR,
    ),
    Sample(
        "PlotJuggler", "plotjuggler.csv", "open cells, brought onto the rows of q_nominal",
        lines("__time,/arm/motor/yaw,/arm/motor/pitch,/cam/yaw,/cam/pitch\n",
              lambda i: f"{BEGIN + T[i]:.6f},{f'{cells(Q[i, :2])},,' if i % 2 else f',,{cells(SEEN[i, :2])}'}"),
        units="rad,rad", truth={"q_nominal": Q[1::2, :2]},
    ),
    Sample("ISO 8601", "iso.csv", "dates", lines("when,q1,q2,q3\n", dated("%Y-%m-%dT%H:%M:%S.%f")), says=("UTC",)),
    Sample(
        "German programs", "german.csv", "day, month, year", lines("when,q1,q2,q3\n", dated("%d.%m.%Y %H:%M:%S.%f")),
        says=("day, month, year",),
    ),
    Sample(
        "US programs", "us.csv", "month, day, year with AM and PM",
        lines("when,q1,q2,q3\n", dated("%m/%d/%Y %I:%M:%S.%f %p")), says=("month, day, year",),
    ),
    Sample(
        "MATLAB `datetime`", "matlab.csv", "months by name",
        lines("when,q1,q2,q3\n", dated("%d-%b-%Y %H:%M:%S.%f")), says=("day, month, year",),
    ),
    Sample(
        "a logger (day and time of day apart)", "apart.csv", "two columns that are one date",
        lines("day,clock,q1,q2,q3\n", dated("%Y/%m/%d,%H:%M:%S.%f")), says=("year, month, day",),
    ),
    Sample(
        "a logger (time of day)", "clock.csv", "over midnight; no date", lines("clock,q1,q2,q3\n", dated("%H:%M:%S.%f")),
        says=("times of day",),
    ),
    Sample(
        "a logger (03/04/2026)", "doubt.csv", "the time, without the day: it may be one of two, which are said",
        lines("when,q1,q2,q3\n", lambda i: f"03/04/2026 10:00:0{T[i]:.2f},{cells(Q[i])}"),
        says=("3/4 may be the 3. of Apr or the 4. of Mar",),
    ),
    Sample(
        "a logger that was killed", "torn.csv", "all but the torn last line",
        lines("t,q1,q2,q3\n", lambda i: cells(ALL[i, :4]), end="\n6.0,0.1,0.2,-"), says=("last line is torn",),
    ),
    Sample(
        "a restarted logger", "again.csv", "names repeated among the rows are skipped",
        lines("t,q1,q2,q3\n", lambda i: cells(ALL[i, :4]) + "\nt,q1,q2,q3" * (i == 300)),
        says=("1 lines of names among the rows were passed over",),
    ),
    Sample(
        "`np.savetxt(header=)`, units apart", "apart.txt", "names followed by units",
        savetxt([T, DEG * Q], header="time [s]  q1 [deg]  q2 [deg]  q3 [mm]"), units=None,
    ),
    Sample(
        "a script, units in the names", "named.csv", "deg/s and mNm by the names; joints of other units stay together",
        named("t_s,q1_deg,q2_deg,q3_mm,dq1_deg_s,dq2_deg_s,dq3_mm_s,tau1_mNm,tau2_mNm,tau3_N",
              T, DEG * Q, DEG * QD, TAU * [1e3, 1e3, 1], fmt="%.12g"),
        says=('units = ["deg", "deg", "mm"]  # per second', "scale = [0.001, 0.001, 1.0]"), units=None, truth=MOVED,
    ),
    Sample(
        "a spreadsheet, units in the names", "sheet.csv", "position, speed and torque of a joint by their units",
        named("t,yaw [°],pitch [°],insertion [mm],yaw [rad/s],pitch [rad/s],insertion [m/s],"
              "yaw [Nm],pitch [Nm],insertion [N]", T, DEG * Q, QD, TAU, fmt="%.12g", encoding="utf-8"),
        units=None, truth=MOVED,
    ),
    Sample(
        "a script over rosbag, C's timespec", "secs.csv", "seconds and nanoseconds in two columns",
        lines("header.stamp.secs,header.stamp.nsecs,q1,q2,q3\n",
              lambda i: f"{BEGIN + i // 100},{i % 100 * 10**7},{cells(Q[i])}"),
        says=("header.stamp.secs in s and header.stamp.nsecs in 1 ns",),
    ),
    Sample(
        "a logger (times of whole seconds)", "coarse.csv", "too coarse for rows of 100 Hz: their rate is asked",
        lines("time,q1,q2,q3\n", lambda i: f"10:00:{i // 100:02d},{cells(Q[i])}"), asks={"rate_hz": "100"},
    ),
    Sample(
        "LabVIEW (10:00:00:120)", "colons.csv", "times of day with a colon before the milliseconds",
        lines("time,q1,q2,q3\n", dated("%H:%M:%S:%f")), says=("times of day",),
    ),
    Sample(
        "Excel for Mac, CSV (Macintosh)", "mac.csv", "",
        lambda path: path.write_bytes(b"t,q1\r0,1\r1,2\r"), refused="its lines end in carriage returns",
    ),
    Sample(
        "reported and measured columns", "reported.csv", "reported is q_nominal, measured q_encoder",
        named("t,measured_1,measured_2,measured_3,reported_1,reported_2,reported_3", T, SEEN, Q), truth=PAIR,
    ),
    Sample(
        "estimated and measured columns", "estimated.csv", "whether measured was measured at the joints is asked",
        named("t,meas_1,meas_2,meas_3,est_1,est_2,est_3", T, SEEN, Q), asks={"q_encoder": "meas"}, truth=PAIR,
    ),
    Sample(
        "motor and camera columns", "camera.csv", "motors report; the camera is q_encoder; the rest is listed",
        named("t,motor_1,motor_2,motor_3,camera_1,camera_2,camera_3,action1,action2,action3", T, Q, SEEN, TAU),
        says=("not used: action1 ... action3",), truth=PAIR,
    ),
    Sample(
        "commanded and actual columns", "actual.csv", "whether actual was measured at the joints is asked",
        named("t,cmd1,cmd2,cmd3,act1,act2,act3", T, Q, SEEN), asks={"q_encoder": "act1"}, truth=PAIR,
    ),
    Sample(
        "two cameras", "two.csv", "which of them is asked",
        named("t,cmd1,cmd2,cmd3,vicon1,vicon2,vicon3,camera1,camera2,camera3", T, Q, SEEN, SEEN + 0.1),
        asks={"q_encoder": "vicon"}, says=("not used: camera1 ... camera3",), truth=PAIR,
    ),
    Sample(
        "two clocks", "clocks.csv", "which of them is asked",
        named("stamp_robot,stamp_pc,q1,q2,q3", T, T + 0.002, Q), asks={"time": "stamp_robot"},
    ),
    Sample(
        "degrees without saying so", "degrees.csv", "units are asked",
        named("t,q1,q2", T, 4.0 * DEG[0] * Q[:, :2]), units=None,
        asks={"q_nominal.units": "deg"}, truth={"q_nominal": 4.0 * Q[:, :2]},
    ),
    Sample(
        "UTF-16 of a spreadsheet", "utf16.csv", "",
        lambda path: path.write_bytes("t,q1\n0,1\n".encode("utf-16")), refused="is UTF-16",
    ),
    Sample(
        "a text that is no table", "notes.txt", "",
        lambda path: path.write_text("remember to\nhome the robot\n"), refused="no column of numbers",
    ),
    Sample(
        "rows of other widths", "ragged.csv", "",
        lines("t,q1,q2\n", lambda i: cells(ALL[i, : 3 - (i == 400)])), refused="cannot be read as CSV",
    ),
]  # fmt: skip
