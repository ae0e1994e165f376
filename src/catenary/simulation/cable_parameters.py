"""The numbers of a cable-driven arm: every one with its unit and where it comes from."""

from importlib.resources import as_file, files
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.config import Settings, load_toml
from catenary.errors import ConfigError

Origin = Literal["source", "datasheet-memory", "assumed", "fitted"]
POSITIONING, TOOLS = 3, 4


class Cable(NamedTuple):
    """The arm as it really is: three positioning joints behind cables, four tool rotors. Read by compiled code."""

    ratio: Floats  # (3,) nominal motor turns per joint [rad/rad, rad/rad, rad/m]
    ratio_error: Floats  # (3,) true ratio over nominal, minus 1
    coupling: Floats  # (3,) true c01, c02, c12
    gearbox: Floats  # (3,) motor turns per capstan turn
    stiffness: Floats  # (3,) [Nm/rad, Nm/rad, N/m]
    damping: Floats  # (3,) [Nm s/rad, Nm s/rad, N s/m]
    elastic_share: Floats  # (3,) of the stiffness, the rest is hysteretic
    hysteresis_width: Floats  # (3,) [rad, rad, m]
    slow_share: Floats  # (3,)
    slow_time: Floats  # (3,) [s]
    rotor_friction: Floats  # (3,) [Nm] at the shaft
    rotor_load_friction: Floats  # (3,) per shaft torque of the load
    link_friction: Floats  # (3,) [Nm, Nm, N]
    link_load_friction: Floats  # (3,) per tension
    capstan_runout: Floats  # (3,) [rad, rad, m]
    capstan_phase: Floats  # (3,) [rad]
    pulley_runout: Floats  # (3,) [rad, rad, m]
    pulley_phase: Floats  # (3,) [rad]
    backlash: Floats  # (3,) total width [rad, rad, m]
    set_rate: Floats  # (3,) per rad or m of travel
    set_side: Floats  # (3,) 1 or -1
    largest_set: Floats  # (3,) [rad, rad, m]
    loss_rate: Floats  # (3,) per rad or m of travel
    reference_tension: Floats  # (3,) [Nm, Nm, N]
    rotor_inertia: Floats  # (3,) [kg m2] at the shaft
    rotor_damping: Floats  # (3,) [Nm s] at the shaft
    stop_position: Floats  # (3,) where the joint meets its stop [rad, rad, m]
    stop_side: Floats  # (3,) -1 for a stop below, 1 above
    stop_stiffness: Floats  # (3,) [Nm/rad, Nm/rad, N/m]
    stop_damping: Floats  # (3,)
    tool_inertia: Floats  # (4,) [kg m2]
    tool_friction: Floats  # (4,) [Nm]
    tool_damping: Floats  # (4,) [Nm s]
    tool_ratio: Floats  # (4,) motor turns per joint turn
    tool_carried: (
        Floats  # (4,) turns of a tool motor per turn of the insertion motor that keep the joint still
    )
    tool_stop: Floats  # (4,) where the tool joints meet their stops, above [rad]
    tool_stop_stiffness: Floats  # (4,) [Nm/rad]


class Firmware(NamedTuple):
    """The robot's own control, and what it believes about the arm. Read by compiled code."""

    ratio: Floats  # (7,) motor per joint
    coupling: Floats  # (3,) nominal c01, c02, c12
    kp: Floats  # (7,) [Nm at the gearbox's output per rad of the motor]
    kd: Floats  # (7,) [Nm s/rad]
    ki: Floats  # (7,) [Nm/(rad s)]
    gearbox: Floats  # (7,)
    torque_constant: Floats  # (7,) [Nm/A]
    dac_per_ampere: Floats  # (7,)
    dac_limit: Floats  # (7,) 0 for never limited
    dac_sign: Floats  # (7,)
    home_threshold: Floats  # (7,) [DAC]
    stop_value: Floats  # (7,) joint position registered at the stop [rad, rad, m, rad...]
    home_value: Floats  # (7,)
    lower: Floats  # (7,) software limits
    upper: Floats  # (7,)
    step_limit: Floats  # (7,) most that a setpoint moves in 1 ms [rad, rad, m, rad...]
    insertion_ratio: Floats  # (1,) insertion motor turns per tool motor turn
    tool_sign: Floats  # (1,) of the insertion motor in the tool's


class Rig(NamedTuple):
    """The external joint encoders."""

    counts: Floats  # (3,) per rad, rad, m
    registered: Floats  # (3,) position that the rig calls the stop [rad, rad, m]
    window: Floats  # (3,) counts within the peak that are averaged


class Entry(Settings):
    """One parameter of the data file."""

    value: list[float]
    unit: str
    origin: Origin
    note: str | None = None


class CableFile(Settings):
    """The data file: what the arm is, what its firmware believes, what the rig measures."""

    name: str
    sources: list[str]
    cable: dict[str, Entry]
    firmware: dict[str, Entry]
    rig: dict[str, Entry]


class CableArm(NamedTuple):
    """A cable-driven arm as its data file has it."""

    name: str
    cable: Cable
    firmware: Firmware
    rig: Rig
    file: CableFile


def load_cable_arm(path: Path | None = None) -> CableArm:
    """Load the RAVEN-II's left arm, or another arm of the kind from a file.

    Raises:
        ConfigError: A parameter is missing, unknown, or of the wrong length; the message names it.
    """
    if path is None:
        with as_file(files("catenary.simulation") / "data" / "raven2.toml") as packaged:
            return load_cable_arm(packaged)
    content = load_toml(path, CableFile)
    return CableArm(
        content.name,
        Cable(**_arrays(path, "cable", content.cable, Cable._fields)),
        Firmware(**_arrays(path, "firmware", content.firmware, Firmware._fields)),
        Rig(**_arrays(path, "rig", content.rig, Rig._fields)),
        content,
    )


def _arrays(path: Path, table: str, entries: dict[str, Entry], names: tuple[str, ...]) -> dict[str, Floats]:
    missing, unknown = [n for n in names if n not in entries], [n for n in entries if n not in names]
    if missing or unknown:
        raise ConfigError(
            f"{path}: [{table}]: missing {', '.join(missing) or 'nothing'}; unknown {', '.join(unknown) or 'nothing'}"
        )
    arrays = {}
    for name in names:
        wanted = _length(table, name)
        values = np.array(entries[name].value, dtype=float)
        if values.shape != (wanted,):
            raise ConfigError(f"{path}: [{table}] {name}: expected {wanted} numbers, got {len(values)}")
        arrays[name] = values
    return arrays


def _length(table: str, name: str) -> int:
    if table == "firmware":
        return {"coupling": 3, "insertion_ratio": 1, "tool_sign": 1}.get(name, POSITIONING + TOOLS)
    return TOOLS if name.startswith("tool_") else POSITIONING


def varied(arm: CableArm, rng: np.random.Generator) -> CableArm:
    """Draw another arm of the same kind: ratios by 1 %, stiffness by 15 %, friction by 20 %, run-out anew in phase."""
    c = arm.cable

    def by(values: Floats, share: float) -> Floats:
        return values * np.exp(share * rng.standard_normal(len(values)))

    cable = c._replace(
        ratio_error=c.ratio_error + 0.01 * rng.standard_normal(POSITIONING),
        coupling=by(c.coupling, 0.05),
        stiffness=by(c.stiffness, 0.15),
        hysteresis_width=by(c.hysteresis_width, 0.15),
        rotor_friction=by(c.rotor_friction, 0.2),
        link_friction=by(c.link_friction, 0.2),
        capstan_runout=by(c.capstan_runout, 0.2),
        pulley_runout=by(c.pulley_runout, 0.2),
        capstan_phase=rng.uniform(-np.pi, np.pi, POSITIONING),
        pulley_phase=rng.uniform(-np.pi, np.pi, POSITIONING),
        tool_friction=by(c.tool_friction, 0.2),
    )
    return arm._replace(cable=cable)


def right_arm(arm: CableArm) -> CableArm:
    """The green arm: DAC signs of the positioning joints and the tool's insertion sign turned, J3's damping lower."""
    f = arm.firmware
    sign, kd = f.dac_sign.copy(), f.kd.copy()
    sign[:POSITIONING] *= -1.0
    kd[2] = 0.010  # RAVEN-II source: gold .012, green .010
    return arm._replace(
        name=f"{arm.name}_right",
        cable=arm.cable._replace(tool_carried=-arm.cable.tool_carried),
        firmware=f._replace(dac_sign=sign, kd=kd, tool_sign=-f.tool_sign),
    )
