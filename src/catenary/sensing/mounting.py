"""Mounting file of an IMU: rotation, position, accelerometer bias and scale, gyroscope bias."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import create_model

from catenary.arrays import Floats, as_array, frozen
from catenary.config import Settings, load_toml
from catenary.errors import ConfigError, InputError
from catenary.files import write_atomically
from catenary.robots.model import RobotModel
from catenary.robots.plausibility import check_within
from catenary.sensing.gravity_vector import Kind
from catenary.spatial import as_rotation

Vector = tuple[float, float, float]
_ZERO = (0.0, 0.0, 0.0)
_MIN_SCALE = 1e-3  # smaller ones, and those beyond _MAX_VALUES, are of damaged files
_HEAD = """# How a sensor of gravity is mounted: true = (reading - bias) / scale in its own axes, which R_base_imu, the
# rotation, takes to those of the frame `base`; position_m is of the sensor, from that frame's origin. checked: the
# gyroscope was held against the accelerometer, in the turns between rests
"""
_MAX_VALUES = {"position": (10.0, "m"), "bias": (1e3, "m/s2"), "scale": (1e3, ""), "rate_bias": (1e3, "rad/s")}


@dataclass(frozen=True)
class Mounting:
    """Pose and errors of a sensor on a base: true = (reading - bias) / scale in its axes; v_base = R_base_imu v_imu."""

    rotation: Floats = field(default_factory=lambda: np.eye(3))  # (3, 3) R_base_imu
    position: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) from the base's origin, in its axes [m]
    bias: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) of the accelerometer [m/s2]
    scale: Floats = field(default_factory=lambda: np.ones(3))  # (3,) of the accelerometer
    rate_bias: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) of the gyroscope [rad/s]
    checked: bool = False  # a tumble has confirmed the gyroscope: it is used from the first rate on
    acceleration_range: float = np.inf  # [m/s2] of each axis, as configured
    rate_range: float = np.inf  # [rad/s]
    sensor: str = ""
    base: str = "base"  # name of the frame whose axes and origin these are

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(as_rotation("mounting rotation", self.rotation)))
        for name in ("position", "bias", "scale", "rate_bias"):
            object.__setattr__(self, name, frozen(as_array(f"mounting {name}", getattr(self, name), (3,))))
        if not (self.scale >= _MIN_SCALE).all():
            raise InputError(f"mounting scale: expected factors of {_MIN_SCALE} or more, got {self.scale.tolist()}")
        for name, (bound, unit) in _MAX_VALUES.items():
            check_within(f"mounting {name}", getattr(self, name), bound, unit)
        for name in ("acceleration_range", "rate_range"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"mounting {name}: expected more than 0, got {getattr(self, name)}")

    def gravity(self, reading: Floats, kind: Kind) -> Floats:
        """Return free-fall acceleration (..., 3) at the sensor in base axes from readings (..., 3) [m/s2] of a kind."""
        force = (reading - self.bias) / self.scale
        turned: Floats = force @ self.rotation.T
        return turned if kind is Kind.FREE_FALL else -turned

    def reading(self, gravity: Floats, kind: Kind) -> Floats:
        """Return the reading (3,) of a kind [m/s2] for free-fall acceleration (3,) at the sensor in base axes."""
        force = gravity @ self.rotation * (1.0 if kind is Kind.FREE_FALL else -1.0)
        return np.asarray(force * self.scale + self.bias)

    def rate(self, reading: Floats) -> Floats:
        """Return angular velocity (..., 3) in base axes from gyroscope readings (..., 3) [rad/s]."""
        return (reading - self.rate_bias) @ self.rotation.T

    def at(self, model: RobotModel, name: str) -> "Mounting":
        """Return the mounting with the pose of a frame of a robot's description, which must be fixed to the base."""
        frame = model.frame(name)
        if frame.link >= 0:
            raise InputError(f'frame "{name}": it moves with {model.link_names[frame.link]}; expected one on the base')
        return replace(self, rotation=frame.pose.rotation, position=frame.pose.position, base=model.base)

    def in_base_of(self, model: RobotModel) -> "Mounting":
        """Return the mounting in the axes of a robot's base; refuse a frame that is not fixed to it."""
        frame = model.frames.get(self.base)
        if self.base == model.base:
            return self
        if frame is None or frame.link >= 0:
            fixed = ", ".join(name for name, known in model.frames.items() if known.link < 0)
            raise InputError(
                f'mounting: its axes are those of "{self.base}", which robot "{model.name}" does not have on its base; '
                f"expected one of {fixed}"
            )
        rotation, position = frame.pose
        place = position + rotation @ self.position
        return replace(self, rotation=rotation @ self.rotation, position=place, base=model.base)


# the file, by section and key: field of Mounting, type, default
_PLACES: dict[str, dict[str, tuple[str, Any, Any]]] = {
    "sensor": {
        "name": ("sensor", str, ""),
        "range_m_s2": ("acceleration_range", float, np.inf),
        "range_rad_s": ("rate_range", float, np.inf),
    },
    "accelerometer": {"bias_m_s2": ("bias", Vector, _ZERO), "scale": ("scale", Vector, (1.0, 1.0, 1.0))},
    "gyroscope": {"bias_rad_s": ("rate_bias", Vector, _ZERO), "checked": ("checked", bool, False)},
    "mounting": {
        "rotation": ("rotation", tuple[Vector, Vector, Vector], ...),  # R_base_imu, by rows
        "position_m": ("position", Vector, _ZERO),
        "base": ("base", str, "base"),
    },
}


class TumbleSection(Settings):
    """Quality of the calibration in the file, for its reader only."""

    readings: int
    residual_m_s2: float | None = None
    rotation_residual_deg: float | None = None


def _file_schema() -> type[Settings]:
    sections: dict[str, Any] = {"tumble": (TumbleSection | None, None)}
    for name, keys in _PLACES.items():
        fields: dict[str, Any] = {key: place[1:] for key, place in keys.items()}
        section = create_model(name, __base__=Settings, **fields)
        sections[name] = section, ... if name == "mounting" else section()
    return create_model("MountingFile", __base__=Settings, **sections)


_SCHEMA = _file_schema()


def load_mounting(path: Path | str) -> Mounting:
    """Load a mounting file (TOML)."""
    content = load_toml(Path(path), _SCHEMA).model_dump()
    values = {place[0]: content[section][key] for section, keys in _PLACES.items() for key, place in keys.items()}
    try:
        return Mounting(**values)
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from error


def save_mounting(path: Path | str, mounting: Mounting, tumble: TumbleSection | None = None) -> None:
    """Write a mounting file atomically.

    Args:
        mounting: Pose and errors of the sensor; infinite ranges are omitted.
        tumble: Quality of the calibration, if known.
    """
    sections = {s: {key: getattr(mounting, of[0]) for key, of in keys.items()} for s, keys in _PLACES.items()}
    sections["tumble"] = {} if tumble is None else tumble.model_dump(exclude_none=True)
    text = _HEAD
    for name, values in sections.items():
        text += f"\n[{name}]\n" if values else ""
        for key, value in values.items():  # for these types TOML equals JSON
            if not (isinstance(value, float) and np.isinf(value)):
                text += f"{key} = {json.dumps(np.asarray(value).tolist(), ensure_ascii=False)}\n".replace("\x7f", " ")
    write_atomically(Path(path), text.encode())
