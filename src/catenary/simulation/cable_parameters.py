"""The numbers of a cable-driven arm: every one with its unit and where it comes from."""

from collections.abc import Mapping
from importlib.resources import as_file, files
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import Field

from catenary.config import Settings, load_toml
from catenary.errors import ConfigError
from catenary.simulation.records import POSITIONING, PerAxis, PerJoint, PerTool, Record

Origin = Literal["source", "datasheet-memory", "assumed", "fitted"]
_MAX_NUMBER = 1e12  # of any of its numbers
# of the package's data: the robot that is simulated when nobody names another, and one of stiff cables, with the little
# friction that Lewis and Hannaford tell of joint 1 (2014)
RAVEN2, RAVEN2_STIFF = "raven2_friction.toml", "raven2.toml"
Parameters = TypeVar("Parameters", bound=Record)


class CableDrive(Record):
    """Motors, gears and cables as they really are, one per joint; [rad, rad, m] are units of a RAVEN-II's joints."""

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
    idler_turns: PerJoint  # of an idler per winding of the cable [rad/rad, rad/rad, rad/m]
    idler_phase: PerJoint  # [rad]
    node_friction: PerJoint  # of idlers on the cable, from its pretension [Nm, Nm, N]
    node_load_friction: PerJoint  # per tension
    node_share: PerJoint  # of the cable's compliance between motor and idlers, between 0 and 1
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
    """A RAVEN-II's arm as it really is: three positioning joints behind cables, four tool rotors."""

    coupling: PerJoint  # true c01, c02, c12
    stop_position: PerJoint  # where the joint meets its stop [rad, rad, m]
    stop_side: PerJoint  # -1 for a stop below, 1 above
    stop_stiffness: PerJoint  # [Nm/rad, Nm/rad, N/m]
    stop_damping: PerJoint
    tool_inertia: PerTool  # [kg m2]
    tool_friction: PerTool  # [Nm]
    tool_stiction: PerTool  # by which friction is larger at rest, as a share of it
    tool_ripple: PerTool  # of friction along the joint, as a share of it
    tool_wave: PerTool  # periods of that ripple per 2 pi of the joint
    tool_damping: PerTool  # [Nm s]
    tool_ratio: PerTool  # motor turns per joint turn
    tool_carried: PerTool  # turns of its motor per turn of the insertion's that keep the joint still
    tool_stop: PerTool  # where the tool joints meet their stops, above [rad]
    tool_stop_stiffness: PerTool  # [Nm/rad]


class AxisFirmware(Record):
    """What any arm's own control has for each axis, and believes of it. Read by compiled code."""

    ratio: PerAxis  # motor turns per joint's, or per actuator's
    kp: PerAxis  # of a RAVEN-II's motors [Nm at the gearbox's output per rad], of a PSM's joints [Nm/rad, N/m]
    kd: PerAxis
    torque_constant: PerAxis  # [Nm/A]
    dac_per_ampere: PerAxis
    home_value: PerAxis  # [rad, rad, m, rad...]
    lower: PerAxis  # joint limits of the setpoints
    upper: PerAxis
    step_limit: PerAxis  # most that a setpoint moves in 1 ms


class Firmware(AxisFirmware):
    """A RAVEN-II's own control."""

    coupling: PerJoint  # nominal c01, c02, c12
    ki: PerAxis  # [Nm/(rad s)]
    gearbox: PerAxis
    dac_limit: PerAxis  # 0 for never limited
    dac_sign: PerAxis
    home_threshold: PerAxis  # [DAC]
    stop_value: PerAxis  # joint position registered at the stop [rad, rad, m, rad...]
    insertion_ratio: float  # insertion motor turns per tool motor turn
    tool_sign: float  # of the insertion motor in the tool's


class Rig(Record):
    """The external joint encoders."""

    counts: PerJoint  # per rad, rad, m
    registered: PerJoint  # position that the rig calls the stop [rad, rad, m]
    window: PerJoint  # counts within the peak that are averaged


class Entry(Settings):
    """One parameter of the data file."""

    value: list[float]
    unit: str
    origin: Origin
    least: list[float] | None = None  # that is plausible, and why in the note
    most: list[float] | None = None
    note: str | None = None


class CableFile(Settings):
    """The data file: what the arm is, what its firmware believes, what the rig measures."""

    name: str
    of: str | None = None  # another file of the package, of which this one has what is different
    sources: list[str]
    reported: Literal["float32", "float64"] = "float64"  # what positions and torques are in its messages
    cable: dict[str, Entry] = Field(default_factory=dict)
    firmware: dict[str, Entry] = Field(default_factory=dict)
    rig: dict[str, Entry] = Field(default_factory=dict)


class CableArm(NamedTuple):
    """A cable-driven arm as its data file has it."""

    name: str
    cable: Cable
    firmware: Firmware
    rig: Rig
    file: CableFile


def load_cable_arm(path: Path | str = RAVEN2) -> CableArm:
    """Load the RAVEN-II's left arm by a data file of the package, or another arm of the kind from a file's path."""
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
    """Return the parameters of a table of a data file, checked."""
    missing = [name for name in kind.fields if name not in entries]
    unknown = [name for name in entries if name not in kind.fields]
    if missing or unknown:
        raise ConfigError(
            f"{path}: [{table}]: missing {', '.join(missing) or 'nothing'}; unknown {', '.join(unknown) or 'nothing'}"
        )
    parameters = kind()
    for name, entry in entries.items():
        field = parameters[name]
        least, most = entry.least or entry.value, entry.most or entry.value
        for given in (entry.value, least, most):
            if len(given) != field.size:
                raise ConfigError(f"{path}: [{table}] {name}: expected {field.size} numbers, got {len(given)}")
        if max(map(abs, entry.value), default=0.0) > _MAX_NUMBER:
            raise ConfigError(f"{path}: [{table}] {name}: {entry.value}, expected numbers of at most {_MAX_NUMBER:g}")
        if not all(a <= x <= b for a, x, b in zip(least, entry.value, most, strict=True)):
            raise ConfigError(f"{path}: [{table}] {name}: {entry.value}, plausible are {least} to {most}")
        field.flat[:] = entry.value
    return parameters


def drawn(parameters: Parameters, rng: np.random.Generator, ratio: float, shares: Mapping[str, float]) -> Parameters:
    """Draw another drive of the kind, its numbers in this order: gears, then each by its share, a phase anew by 0."""
    found = parameters.copy()
    found["ratio_error"] += ratio * rng.standard_normal(found["ratio_error"].size)
    for name, share in shares.items():
        n = found[name].size
        found[name] = found[name] * np.exp(share * rng.standard_normal(n)) if share else rng.uniform(-np.pi, np.pi, n)
    return found


# of stiffness, friction and run-out
_SHARES = {
    "coupling": 0.05, "stiffness": 0.15, "hysteresis_width": 0.15, "rotor_friction": 0.2, "link_friction": 0.2,
    "capstan_runout": 0.2, "pulley_runout": 0.2, "capstan_phase": 0.0, "pulley_phase": 0.0, "tool_friction": 0.2,
}  # fmt: skip
# of idlers, the set's wandering and tools; drawn beside the others, which so are what they are without these
_FURTHER_SHARES = {
    "idler_runout": 0.2, "idler_phase": 0.0, "node_friction": 0.2, "set_wander": 0.2, "tool_stiction": 0.2,
    "tool_ripple": 0.2, "tool_wave": 0.2,
}  # fmt: skip


def varied(arm: CableArm, rng: np.random.Generator) -> CableArm:
    """Draw another arm of the same kind: ratios by 1 %, stiffness by 15 %, friction by 20 %, run-out anew in phase."""
    further = rng.spawn(1)[0]
    return arm._replace(cable=drawn(drawn(arm.cable, rng, 0.01, _SHARES), further, 0.0, _FURTHER_SHARES))


def right_arm(arm: CableArm) -> CableArm:
    """Return the green arm: other DAC signs at the positioning joints, the tool on the other side, J3 less damped."""
    f = arm.firmware
    sign, kd = f.dac_sign.copy(), f.kd.copy()
    sign[:POSITIONING] *= -1.0
    kd[2] = 0.010  # RAVEN-II source: gold .012, green .010
    return arm._replace(
        name=f"{arm.name}_right",
        cable=arm.cable.replace(tool_carried=-arm.cable.tool_carried),
        firmware=f.replace(dac_sign=sign, kd=kd, tool_sign=-f.tool_sign),
    )
