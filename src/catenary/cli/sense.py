"""catenary sense: gravity as a sensor on the base measures it, and that sensor's calibration."""

import math
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli.exit_codes import FAULT_FOUND
from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE, MOUNTING_FILE, ReadingOptions, SensingOptions
from catenary.cli.options import Names, group, json_help, option, require_one, values_of
from catenary.cli.out_files import MOUNTING, refuse_outputs
from catenary.cli.terminal import print_notes, print_result, prints_json
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.recording.import_formats.imu_recording import ImuRecording
    from catenary.sensing.gravity_vector import GravityReading
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.mounting import Mounting
    from catenary.simulation.sensors import SensorModel
    from catenary.workflows.sense import Attitude, Feed, SenseSummary, StillReading, TumbleOutcome

_LINE_EVERY = 1.0  # [s]


@group
class ReplayOptions:
    """A recording in place of a sensor."""

    replay: Path | None = option("FILE", "Read a recorded sensor: a bag, or a CSV with time, ax, ay, az, gx, gy, gz.")
    topic: str | None = option("TOPIC", "Topic to read from a bag with several sensor_msgs/Imu.", goes_with="replay")
    columns: Names | None = option("C,C,C[,...]", "Accelerometer's columns, then gyroscope's.", goes_with="replay")
    time: str | None = option("COLUMN[@UNIT]", "Time column of a table, in s, ms, us or ns.", goes_with="replay")
    orientations: Path | None = option(
        "CSV", "With --tumble: roll_deg,pitch_deg at each rest, or the joints of --robot.", goes_with="replay"
    )
    robot: str | None = option("ROBOT", "Arm that carried the sensor, on a level base.", goes_with="orientations")
    frame: str | None = option("NAME", "Its link with the sensor. [default: the tip]", goes_with="orientations")

    def recording(self, reading: ReadingOptions, *, tumble: bool) -> "ImuRecording | None":
        """Return the recording to replay; None without --replay."""
        if self.replay is None:
            return None
        if tumble is not (self.orientations is not None):
            raise InputError(
                "--tumble of a --replay: give both --tumble and --orientations CSV (roll_deg,pitch_deg at each rest)"
            )
        from catenary.recording.import_formats.imu_recording import read_imu

        found = read_imu(
            self.replay, topic=self.topic, columns=self.columns or (), time=self.time,
            matrices=reading.convention(), has_units=reading.has_units,
        )  # fmt: skip
        print_notes(found.notes)
        return found

    def calibrated(self, recording: "ImuRecording", known: "Mounting") -> "TumbleOutcome":
        """Calibrate the sensor by its rests in a recording."""
        from catenary.workflows.sense import calibrate_replay, read_orientations

        model = None if self.robot is None else catenary.load_robot(self.robot)
        start = known if model is None else replace(known, base=self.frame or model.tip)
        return calibrate_replay(
            recording, read_orientations(self.orientations or Path(), model, self.frame), start=start
        )


@group
class SimulatedSensorOptions:
    """A simulated sensor in place of one."""

    simulated: bool = option(None, "Use a simulated sensor.", False)
    base_tilt_deg: tuple[float, float] | None = replace(BASE_TILT, goes_with="simulated")
    rate: float | None = option("HZ", "Sample rate of the simulated sensor. [default: 200]", goes_with="simulated")
    seed: int = option(None, "Seed of the simulated sensor's noise.", 0, least=0, goes_with="simulated")

    def model(self, known: "Mounting") -> "SensorModel":
        """Return the simulated sensor, whose stated mounting is true."""
        from catenary.simulation.sensors import SensorModel

        model = SensorModel(200.0 if self.rate is None else self.rate)
        ranges = ("acceleration_range", "rate_range")
        least = {key: min(getattr(known, key), getattr(model.mounting, key)) for key in ranges}
        return replace(model, mounting=replace(known, **least))

    def feed(self, model: "SensorModel") -> "Feed":
        """Return its samples on a base at rest."""
        from catenary.sensing.gravity_vector import Mailbox
        from catenary.simulation.base_motion import FixedBase
        from catenary.simulation.sensors import SimulatedSensor
        from catenary.workflows.sense import simulated_feed

        base = FixedBase(*map(math.radians, self.base_tilt_deg or LEVEL_BASE))
        sensor = SimulatedSensor(base, Mailbox(), model, seed=self.seed)
        return simulated_feed(sensor, paced=sys.stdout.isatty())


@json_help("Print one JSON summary at the end.")
def sense(
    sensing: SensingOptions,
    simulation: SimulatedSensorOptions,
    replaying: ReplayOptions,
    reading: ReadingOptions,
    port: str | None = option("PORT", "Serial port, as /dev/ttyACM0."),
    duration: float | None = option("S", "How long to watch. [default: 5; until Ctrl-C on a terminal]"),
    mounting: Path | None = MOUNTING_FILE,
    tumble: bool = option(None, "Calibrate the sensor in several attitudes and write a mounting file.", False),
    out: Path | None = option(
        "FILE", "What --tumble writes. [default: mounting.toml]", writes=MOUNTING, goes_with="tumble"
    ),
) -> None:
    """Show gravity as a sensor on the base measures it.

    With --tumble it calibrates the sensor. On a moving base, give the platform type by --mounting-on. --replay reads a
    recording in place of a sensor. The exit code is 1 when no sample was valid, or a tumble found a fault.

    Example: catenary sense --simulated --base-tilt-deg 10,5 --duration 2 --mounting-on ship
    Example: catenary sense --replay imu.csv --tumble --orientations turned.csv --out mounting.toml
    """
    from catenary.crtk.transforms import recorded_pose
    from catenary.devices.accelerometer import SerialAccelerometer
    from catenary.sensing.gravity_vector import MAILBOX_SIZE, Mailbox
    from catenary.sensing.mounting import Mounting, load_mounting
    from catenary.workflows.sense import ATTITUDES, SETTLE, Feed, replay_feed, run_tumble, simulated_reader

    require_one(port=port, simulated=simulation.simulated, replay=replaying.replay)
    out = out or Path("mounting.toml")
    if tumble:
        refuse_outputs({"--out": (out, MOUNTING)}, [mounting] if mounting else [])
    bag = replaying.replay
    by_tf = None if bag is None else partial(recorded_pose, bag)
    known = reading.mounted(Mounting() if mounting is None else load_mounting(mounting), by_tf)
    recording = replaying.recording(reading, tumble=tumble)
    model = simulation.model(known)
    if simulation.simulated:
        known = model.mounting
    if tumble and port is None:
        if recording is None:
            outcome = run_tumble(simulated_reader(model, seed=simulation.seed), start=known)
        else:
            outcome = replaying.calibrated(recording, known)
        _conclude_tumble(outcome, out)
        return
    with ExitStack() as stack:
        if recording is not None:
            feed, left = replay_feed(recording), recording.duration - SETTLE
            duration = left if duration is None else min(duration, left)
        elif port is not None:
            size = 100 * MAILBOX_SIZE if tumble else MAILBOX_SIZE  # the turns of a tumble are kept while nobody reads
            device = stack.enter_context(SerialAccelerometer(port, Mailbox(size, reading.convention())))
            hello = device.wait_ready()
            print_notes([f"{port}: {hello.sensor}, {hello.rate_hz:g} Hz"])
            feed = Feed(device.mailbox, hello.has_gyroscope, link=lambda: asdict(device.counts))
            known = device.with_ranges(known)
        else:
            feed = simulation.feed(model)
        if tumble:
            print_notes([f"{len(ATTITUDES)} attitudes; put the sensor there, let go of it, then press Enter"])
            _conclude_tumble(run_tumble(_by_hand(feed), start=known, taken=feed.taken), out)
        else:
            _watch(feed, sensing.source(feed.mailbox, known, angular=feed.has_gyroscope), duration)


def _watch(feed: "Feed", source: "SensedGravity", duration: float | None) -> None:
    from catenary.workflows.sense import watch

    length = (math.inf if sys.stdout.isatty() and not prints_json() else 5.0) if duration is None else duration
    last = -math.inf

    def line(reading: "GravityReading", time: float) -> None:
        nonlocal last
        if time - last >= _LINE_EVERY and not prints_json():
            last = time
            print(f"{time:8.1f} s  {_lines(reading, source.mounting.base)[0]}  {' '.join(reading.faults.names)}")

    summary = watch(feed, source, length, show=line)
    print_result(summary.as_data(), *_in_words(summary))
    if not summary.was_live:
        raise typer.Exit(FAULT_FOUND)


def _lines(reading: "GravityReading", base: str) -> list[str]:
    from catenary.sensing.gravity_vector import tilt_angle, tilt_of

    x, y, z = reading.gravity
    roll, pitch = map(math.degrees, tilt_of(reading.gravity))
    age = "never measured" if math.isinf(reading.age) else f"{1000.0 * reading.age:.0f} ms old"
    rates = map(math.degrees, reading.base_rates[0])
    return [
        f"gravity {x:+7.3f} {y:+7.3f} {z:+7.3f} m/s2 in axes of {base}, length {math.hypot(x, y, z):.3f}, "
        f"tilt {math.degrees(tilt_angle(reading.gravity)):.2f} deg, {age}, {reading.status.value}",
        f"roll {roll:+.2f} deg, pitch {pitch:+.2f} deg",
        "turning " + " ".join(f"{v:+.2f}" for v in rates) + " deg/s",
    ]


def _in_words(summary: "SenseSummary") -> list[Any]:
    lines, facts = _lines(summary.reading, summary.base), list[tuple[str, str]]()
    if summary.was_live:
        spread = ", ".join(f"{v:.4f}" for v in summary.spread)
        mean = ", ".join(f"{v:.4f}" for v in summary.mean)
        lines.append(f"mean of {summary.duration:.1f} s: {mean} m/s2, standard deviation {spread} m/s2")
    if summary.remedy:
        facts.append(("WRONG:", f"the gyroscope: {summary.remedy}"))
    for (name, count), message in zip(summary.gravity.faults.items(), summary.gravity.messages, strict=True):
        share = 100.0 * count / max(1, sum(summary.gravity.ticks.values()))
        facts.append(("WARNING:", f"{name} for {share:.1f} % of the time: {message}"))
    line = "line: " + ", ".join(f"{k} {v}" for k, v in summary.link.items()) if summary.link else None
    nothing = None if all(map(math.isfinite, summary.mean)) else "no valid sample was measured"
    return [*lines, facts, line, nothing]


def _by_hand(feed: "Feed") -> "Callable[[Attitude], StillReading]":
    from catenary.workflows.sense import ATTITUDES, read_still

    def read(attitude: "Attitude") -> "StillReading":
        which = f"{ATTITUDES.index(attitude) + 1}/{len(ATTITUDES)}"
        print(f"{which} {attitude.instruction}; Enter ", end="", file=sys.stderr, flush=True)
        if not _enter_pressed():
            raise InputError("sense: --tumble needs somebody at the keyboard, and standard input has ended")
        reading = read_still(feed)
        print("   " + " ".join(f"{v:+.3f}" for v in reading.force) + " m/s2", file=sys.stderr)
        return reading

    return read


def _enter_pressed() -> bool:
    return bool(sys.stdin.readline())  # not at the end of standard input


def _conclude_tumble(outcome: "TumbleOutcome", out: Path) -> None:
    from catenary.sensing.mounting import save_mounting

    m, section = outcome.mounting, outcome.section
    if not outcome.faults:
        save_mounting(out, m, section)
    content = {
        "mounting": None if outcome.faults else str(out),
        **values_of(m, "bias", "scale", "rate_bias", "rotation", "checked", "base"),
        "residual": section.residual_m_s2, "rotation_residual_deg": section.rotation_residual_deg,
        "readings": section.readings, "faults": list(outcome.faults),
    }  # fmt: skip
    rows = [("bias", m.bias, "m/s2"), ("scale", m.scale, ""), ("rate bias", m.rate_bias, "rad/s")]
    rows += zip(("R_base_imu", "", ""), m.rotation, ("", "", ""), strict=True)
    facts = [(name, f"{' '.join(f'{v:+.4f}' for v in values)} {unit}".rstrip()) for name, values, unit in rows]
    unchecked = "not checked" if outcome.faults else "not checked: no turns between the rests"
    facts += [("gyroscope", "turns as gravity does" if m.checked else unchecked), ("base", m.base)]
    facts += [] if section.residual_m_s2 is None else [("residual", f"{section.residual_m_s2:.4f} m/s2")]
    facts += [("WRONG:", fault) for fault in outcome.faults]
    print_result(content, facts, "nothing written" if outcome.faults else f"written to {out}")
    if outcome.faults:
        raise typer.Exit(FAULT_FOUND)
