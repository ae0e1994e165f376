"""A RobotModel as plain data and back, so that a file made from a robot needs no other file to be used."""

from dataclasses import asdict, fields
from typing import Any, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.errors import FileFormatError
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    SignalFilter,
    Spring,
    Weighting,
    check_actuation,
)
from catenary.robots.model import Frame, RobotModel, Tree
from catenary.spatial import Pose

NAMES = ("joint_names", "joint_units", "link_names", "missing_inertia", "massless", "sources", "notes")
LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity_limit": np.inf, "effort_limit": np.inf}  # where null
TREE_SHAPES: dict[str, tuple[int, ...]] = {
    "parent": (),
    "prismatic": (),
    "rotation": (3, 3),
    "origin": (3,),
    "axis": (3,),
    "mass": (),
    "com": (3,),
    "inertia": (3, 3),
}
TREE_TYPES = {"parent": np.int64, "prismatic": np.bool_}  # float64 otherwise
TERMS = {"friction": Friction, "motor_inertia": MotorInertia, "springs": Spring, "known_torques": KnownTorque}


def robot_record(model: RobotModel) -> dict[str, Any]:
    """Return a robot as plain data for JSON; infinite limits are null."""
    return {
        "name": model.name,
        "tip": model.tip,
        "closed_form": model.closed_form,
        **{key: list(getattr(model, key)) for key in NAMES},
        **{key: getattr(model, key).tolist() for key in ("coupling", "offset")},
        **{key: [float(v) if np.isfinite(v) else None for v in getattr(model, key)] for key in LIMITS},
        "tree": {key: array.tolist() for key, array in model.tree._asdict().items()},
        "frames": {
            name: [f.link, f.pose.rotation.tolist(), f.pose.position.tolist()]
            for name, f in model.frames.items()
        },
        "actuation": None if model.actuation is None else asdict(model.actuation, dict_factory=_plain),
    }


def robot_from_record(record: dict[str, Any]) -> RobotModel:
    """Return the robot of a record.

    Raises:
        FileFormatError: Something is missing, or arrays do not fit together.
    """
    try:
        links, n = len(record["link_names"]), len(record["joint_names"])
        tree: dict[str, Any] = {
            key: _array(record["tree"][key], (links, *shape), key).astype(TREE_TYPES.get(key, np.float64))
            for key, shape in TREE_SHAPES.items()
        }
        if not all(-1 <= parent < i for i, parent in enumerate(tree["parent"])):
            raise ValueError("the tree's parents do not come first")
        limits: dict[str, Any] = {
            key: _array([none if v is None else v for v in record[key]], (n,), key, infinite=True)
            for key, none in LIMITS.items()
        }
        frames = {
            name: Frame(_link(link, links), Pose(_array(R, (3, 3), name), _array(p, (3,), name)))
            for name, (link, R, p) in record["frames"].items()
        }
        if record["tip"] not in frames:
            raise ValueError(f"tip {record['tip']!r} is no frame")
        actuation = None if record["actuation"] is None else _actuation(record["actuation"])
        if actuation is not None:
            check_actuation(record["name"], actuation, n)
        texts: dict[str, Any] = {key: tuple(str(text) for text in record[key]) for key in NAMES}
        return RobotModel(
            name=str(record["name"]),
            tip=record["tip"],
            closed_form=record["closed_form"],
            **texts,
            tree=Tree(**tree),
            coupling=_array(record["coupling"], (links, n), "coupling"),
            offset=_array(record["offset"], (links,), "offset"),
            **limits,
            frames=frames,
            actuation=actuation,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"the robot in it is damaged: {error!r}") from error


def _plain(items: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a data class's fields with arrays as lists."""
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in items}


def _array(values: Any, shape: tuple[int, ...], key: str, *, infinite: bool = False) -> Floats:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not (infinite or np.isfinite(array).all()):
        raise ValueError(f"{key} has shape {array.shape}, expected {shape} of finite numbers")
    return array


def _link(value: Any, count: int) -> int:
    if not -1 <= int(value) < count:
        raise ValueError(f"a frame stands on link {value} of {count}")
    return int(value)


def _actuation(content: dict[str, Any]) -> Actuation:
    unknown = set(content) - {entry.name for entry in fields(Actuation)}
    if unknown or content["weighting"] not in get_args(Weighting):
        raise ValueError(f"actuation with {', '.join(unknown) or content['weighting']}")
    terms: dict[str, Any] = {
        kind: tuple(term(**_values(entry)) for entry in content[kind]) for kind, term in TERMS.items()
    }
    rest = _values({key: value for key, value in content.items() if key not in TERMS})
    return Actuation(**terms, **(rest | {"coulomb_velocity": float(content["coulomb_velocity"])}))


def _values(content: dict[str, Any]) -> dict[str, Any]:
    """Return a term's fields: lists as arrays, a lever and a filter as what they are."""
    values: dict[str, Any] = {
        key: _array(v, (len(v),), key) if isinstance(v, list) else v for key, v in content.items()
    }
    for key, kind in (("lever", LeverSpring), ("filter", SignalFilter)):
        if isinstance(values.get(key), dict):
            values[key] = kind(**values[key])
    return values
