"""Parameters of a simulated cable-driven arm (RAVEN-II): drives, firmware, encoder rig; data files, random arms."""

from collections.abc import Mapping
from importlib.resources import as_file, files
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import Field

from catenary.config import Settings, load_toml
from catenary.errors import ConfigError
from catenary.simulation.compiled_records import POSITIONING, PerAxis, PerJoint, PerTool, Record

Origin = Literal["source", "datasheet-memory", "assumed", "fitted"]
_MAX_NUMBER = 1e12  # of any parameter
# data files of the package: the default robot, one with stiff cables and the low friction that Lewis and Hannaford
# (2014) report of joint 1, and the default one with external encoders off their centres
RAVEN2, RAVEN2_STIFF, RAVEN2_ECCENTRIC = "raven2_friction.toml", "raven2.toml", "raven2_eccentric.toml"
Parameters = TypeVar("Parameters", bound=Record)


class CableDrive(Record):
    """True parameters of motors, gears and cables, one per joint; [rad, rad, m] are units of a RAVEN-II's joints."""

    ratio: PerJoint  # nominal motor turns per joint [rad/rad, rad/rad, rad/m]
    ratio_error: PerJoint  # true ratio over nominal, minus 1
    gearbox: PerJoint  # motor turns per capstan turn
    stiffness: PerJoint  # [Nm/rad, Nm/rad, N/m]
    damping: PerJoint  # [Nm s/rad, Nm s/rad, N s/m]
    elastic_share: PerJoint  # of the stiffness, the rest is hysteretic
    hysteresis_width: PerJoint  # [rad, rad, m]
    slow_share: PerJoint
    slow_time: PerJoint  # [s]
    rotor_friction: PerJoint  # [Nm] at the shaft
    rotor_load_friction: PerJoint  # per shaft torque of the load
    link_friction: PerJoint  # [Nm, Nm, N]
    link_load_friction: PerJoint  # per tension
    capstan_runout: PerJoint  # [rad, rad, m]
    capstan_phase: PerJoint  # [rad]
    pulley_runout: PerJoint  # [rad, rad, m]
    pulley_phase: PerJoint  # [rad]
    idler_runout: PerJoint  # [rad, rad, m]
    idler_turns: PerJoint  # turn of an idler per winding of the cable [rad/rad, rad/rad, rad/m]
    idler_phase: PerJoint  # [rad]
    node_friction: PerJoint  # of idlers on the cable, from its pretension [Nm, Nm, N]
    node_load_friction: PerJoint  # per tension
    node_share: PerJoint  # share of the cable's compliance between motor and idlers, 0 to 1
    backlash: PerJoint  # total width [rad, rad, m]
    set_rate: PerJoint  # per rad or m of travel
    set_side: PerJoint  # 1 or -1
    set_wander: PerJoint  # per square root of travel [rad^1/2, rad^1/2, m^1/2]
    largest_set: PerJoint  # [rad, rad, m]
    loss_rate: PerJoint  # per rad or m of travel
    reference_tension: PerJoint  # [Nm, Nm, N]
    rotor_inertia: PerJoint  # [kg m2] at the shaft
    rotor_damping: PerJoint  # [Nm s] at the shaft


class Cable(CableDrive):
    """True parameters of a RAVEN-II's arm: three positioning joints behind cables, four tool rotors."""

    coupling: PerJoint  # true c01, c02, c12
    stop_position: PerJoint  # of the mechanical stop [rad, rad, m]
    stop_side: PerJoint  # -1 for a stop below, 1 above
    stop_stiffness: PerJoint  # [Nm/rad, Nm/rad, N/m]
    stop_damping: PerJoint
    tool_inertia: PerTool  # [kg m2]
    tool_friction: PerTool  # [Nm]
    tool_stiction: PerTool  # additional friction at rest, relative
    tool_ripple: PerTool  # amplitude of friction's variation along the joint, relative
    tool_wave: PerTool  # periods of that ripple per 2 pi of the joint
    tool_damping: PerTool  # [Nm s]
    tool_ratio: PerTool  # motor turns per joint turn
    tool_carried: PerTool  # turns of its motor per turn of the insertion's motor with the joint at rest
    tool_stop: PerTool  # upper stops of the tool joints [rad]
    tool_stop_stiffness: PerTool  # [Nm/rad]


class AxisFirmware(Record):
    """Control parameters of each axis, as the firmware of any arm has them; read by compiled code."""

    ratio: PerAxis  # nominal motor turns per turn of the joint or actuator
    kp: PerAxis  # of a RAVEN-II's motors [Nm at the gearbox's output per rad], of a PSM's joints [Nm/rad, N/m]
    kd: PerAxis
    torque_constant: PerAxis  # [Nm/A]
    dac_per_ampere: PerAxis
    home_value: PerAxis  # [rad, rad, m, rad...]
    lower: PerAxis  # joint limits of the setpoints
    upper: PerAxis
    step_limit: PerAxis  # largest change of a setpoint in 1 ms


class Firmware(AxisFirmware):
    """Control parameters of a RAVEN-II."""

    coupling: PerJoint  # nominal c01, c02, c12
    ki: PerAxis  # [Nm/(rad s)]
    gearbox: PerAxis
    dac_limit: PerAxis  # 0 for no limit
    dac_sign: PerAxis
    home_threshold: PerAxis  # [DAC]
    stop_value: PerAxis  # joint position registered at the stop [rad, rad, m, rad...]
    insertion_ratio: float  # insertion motor turns per tool motor turn
    tool_sign: float  # of the insertion motor in the tool's


class Rig(Record):
    """Parameters of the external joint encoders."""

    counts: PerJoint  # per rad, rad, m
    registered: PerJoint  # position assigned to the stop [rad, rad, m]
    window: PerJoint  # counts below the peak that are averaged
    eccentricity: PerJoint  # of an encoder's coupling: how far off its centre, over its radius
    eccentric_phase: PerJoint  # joint position at which it reads most too much [rad]


class Entry(Settings):
    """One parameter of a data file."""

    value: list[float]
    unit: str
    origin: Origin
    least: list[float] | None = None  # plausible range, justified in the note
    most: list[float] | None = None
    note: str | None = None


class CableFile(Settings):
    """A data file: true parameters of the arm, nominal ones of its firmware, and those of the rig."""

    name: str
    of: str | None = None  # another file of the package, whose parameters this one overrides
    sources: list[str]
    reported: Literal["float32", "float64"] = "float64"  # type of positions and torques in its messages
    cable: dict[str, Entry] = Field(default_factory=dict)
    firmware: dict[str, Entry] = Field(default_factory=dict)
    rig: dict[str, Entry] = Field(default_factory=dict)


class CableArm(NamedTuple):
    """A cable-driven arm as defined by its data file."""

    name: str
    cable: Cable
    firmware: Firmware
    rig: Rig
    file: CableFile


def load_cable_arm(path: Path | str = RAVEN2) -> CableArm:
    """Load a cable-driven arm from a data file of the package, by its name, or from another, by its path."""
    if isinstance(path, str):
        with as_file(files("catenary.simulation") / "data" / path) as packaged:
            return load_cable_arm(packaged)
    content = load_toml(path, CableFile)
    if content.of is not None:
        whole = load_cable_arm(content.of).file
        tables = {table: getattr(whole, table) | getattr(content, table) for table in ("cable", "firmware", "rig")}
        content = content.model_copy(update=tables)
    return CableArm(
        content.name,
        parameters_of(path, "cable", content.cable, Cable),
        parameters_of(path, "firmware", content.firmware, Firmware),
        parameters_of(path, "rig", content.rig, Rig),
        content,
    )


def parameters_of(path: Path, table: str, entries: dict[str, Entry], kind: type[Parameters]) -> Parameters:
    """Check the entries of a data file's table and return them as a record."""
    missing = [name for name in kind.fields if name not in entries]
    unknown = [name for name in entries if name not in kind.fields]
    if missing or unknown:
        raise ConfigError(
            f"{path}: [{table}]: missing {', '.join(missing) or 'nothing'}; unknown {', '.join(unknown) or 'nothing'}"
        )
    parameters = kind()
    for name, entry in entries.items():
        field = parameters[name]
        lower, upper = entry.least or entry.value, entry.most or entry.value
        for values in (entry.value, lower, upper):
            if len(values) != field.size:
                raise ConfigError(f"{path}: [{table}] {name}: expected {field.size} numbers, got {len(values)}")
        if max(map(abs, entry.value), default=0.0) > _MAX_NUMBER:
            raise ConfigError(f"{path}: [{table}] {name}: {entry.value}, expected numbers of at most {_MAX_NUMBER:g}")
        if not all(a <= x <= b for a, x, b in zip(lower, entry.value, upper, strict=True)):
            raise ConfigError(f"{path}: [{table}] {name}: {entry.value}, plausible are {lower} to {upper}")
        field.flat[:] = entry.value
    return parameters


def varied(parameters: Parameters, rng: np.random.Generator, ratio: float, shares: Mapping[str, float]) -> Parameters:
    """Draw a random drive of the same kind.

    `ratio` is the standard deviation added to ratio errors, `shares` the log-standard deviation of other parameters, in
    order; 0 draws a phase uniformly.
    """
    drive = parameters.copy()
    drive["ratio_error"] += ratio * rng.standard_normal(drive["ratio_error"].size)
    for name, share in shares.items():
        n = drive[name].size
        drive[name] = drive[name] * np.exp(share * rng.standard_normal(n)) if share else rng.uniform(-np.pi, np.pi, n)
    return drive


# relative variation of stiffness, friction and run-out
_SHARES = {
    "coupling": 0.05, "stiffness": 0.15, "hysteresis_width": 0.15, "rotor_friction": 0.2, "link_friction": 0.2,
    "capstan_runout": 0.2, "pulley_runout": 0.2, "capstan_phase": 0.0, "pulley_phase": 0.0, "tool_friction": 0.2,
}  # fmt: skip
# the same of idlers, random set and tools, from another generator, so that the others do not depend on them
_FURTHER_SHARES = {
    "idler_runout": 0.2, "idler_phase": 0.0, "node_friction": 0.2, "set_wander": 0.2, "tool_stiction": 0.2,
    "tool_ripple": 0.2, "tool_wave": 0.2,
}  # fmt: skip


def varied_arm(arm: CableArm, rng: np.random.Generator) -> CableArm:
    """Draw a random arm of the same kind: ratios by 1 %, stiffness by 15 %, friction by 20 %, run-out in any phase."""
    further = rng.spawn(1)[0]
    return arm._replace(cable=varied(varied(arm.cable, rng, 0.01, _SHARES), further, 0.0, _FURTHER_SHARES))


def right_arm(arm: CableArm) -> CableArm:
    """Return the right (green) arm: opposite DAC signs of positioning joints, mirrored tool, less damping of J3."""
    f = arm.firmware
    sign, kd = f.dac_sign.copy(), f.kd.copy()
    sign[:POSITIONING] *= -1.0
    kd[2] = 0.010  # RAVEN-II source: gold .012, green .010
    return arm._replace(
        name=f"{arm.name}_right",
        cable=arm.cable.replace(tool_carried=-arm.cable.tool_carried),
        firmware=f.replace(dac_sign=sign, kd=kd, tool_sign=-f.tool_sign),
    )
