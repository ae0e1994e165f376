"""Identified parameters on disk: a NumPy archive that executes nothing, with its card inside and beside it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, JsonValue

from catenary import __version__
from catenary.archives import content_in_words, read_arrays
from catenary.arrays import Floats
from catenary.cards import card_of, write_with_card
from catenary.config import Recorded, parse_settings
from catenary.documents import cut, json_table, shortened
from catenary.errors import FileFormatError, InputError
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.friction_choice import FrictionPart
from catenary.identification.identification import Identification
from catenary.identification.identify_options import IdentifyOptions, Terms
from catenary.identification.parameters import Parameters
from catenary.identification.residuals import LogResidual, MovedRange, Verdict
from catenary.robots.actuation import Weighting
from catenary.robots.identified import IDENTIFIED, REMEDY
from catenary.robots.model_record import robot_from_record, robot_record

FORMAT = "catenary.identification.1"
Card = dict[str, Any]
Residuals = tuple[float | None, ...]


class OptionsRecord(Recorded):
    """Options of an identification, as `IdentifyOptions`."""

    terms: Terms
    gravity: tuple[float, float, float]
    cutoff_hz: float | None
    order: Annotated[int, Field(ge=1, le=10)] | None
    cut_samples: int | None
    period_samples: int | None
    weighting: Weighting | None
    consistent: bool
    friction: tuple[str, ...] = ()
    prior: bool = False
    blocks: float | None
    seed: Annotated[int, Field(ge=0)]


class ResidualRecord(Recorded):
    """The residual of a recording, as `LogResidual`; null on an axis without torque."""

    log: str
    rows: int
    relative_rms: Residuals
    relative_rms_period: Residuals | None
    rms: Residuals
    verdict: Verdict | None
    reasons: tuple[str, ...] = ()


class MotionRecord(Recorded):
    """How the recordings moved that were fitted, as `MovedRange`."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    speed: tuple[float, ...]


class FrictionPartRecord(Recorded):
    """A part that held-out blocks added to a friction, as `FrictionPart`."""

    friction: str
    kind: str
    scale: float | None
    gain: float


class IdentificationStructure(Recorded):
    """All of an identification but its arrays."""

    robot: JsonValue  # `robot_from_record` knows its schema
    options: OptionsRecord
    rank: int
    condition: float
    training: tuple[ResidualRecord, ...]
    tests: tuple[ResidualRecord, ...]
    friction: tuple[FrictionPartRecord, ...] = ()
    prior_weight: float | None = None
    moved_base: bool = False
    seen: MotionRecord | None = None


class IdentificationCard(Recorded):
    """What readers of a card take from it; more may stand there."""

    notes: tuple[str, ...]
    version: dict[str, JsonValue]


def identification_card(
    result: Identification,
    data: list[dict[str, Any]],
    notes: tuple[str, ...] = (),
    mends: Mapping[str, Sequence[str]] | None = None,
) -> Card:
    """Describe an identification: everything a stranger must know before using its parameters.

    Args:
        result: What was identified.
        data: The recordings that were fitted and tested, as plain data.
        notes: What was decided on the way.
        mends: How the recordings that were fitted were mended; see `MotionLog.settled`.
    """
    base = result.base
    return {
        "robot": result.model.name,
        "joints": [
            {"name": n, "unit": u}
            for n, u in zip(result.model.joint_names, result.model.joint_units, strict=True)
        ],
        "options": asdict(result.options),
        "n_base": base.count,
        "rank": result.rank,
        "condition": result.condition,
        "physically_consistent": result.phi is not None,
        "prior_weight": result.prior_weight,
        "friction": [asdict(part) for part in result.friction],
        "parameters": [
            {
                "name": base.names[i],
                "value": float(result.beta[i]),
                "std": float(result.std[i]),
                "unit": base.units[i],
                "is": base.describe(i),
            }
            for i in range(base.count)
        ],
        "training": [residual_record(r) for r in result.training],
        "tests": [residual_record(r) for r in result.tests],
        "data": data,
        "mends": {key: list(texts) for key, texts in (mends or {}).items()},
        "notes": list(notes),
        "version": {"catenary": __version__, "numpy": np.__version__},
    }


def residual_record(result: LogResidual) -> dict[str, Any]:
    """Return a residual as plain data; NaN, on an axis without torque, is null."""

    def plain(values: Floats | None) -> list[float | None] | None:
        return None if values is None else [float(v) if np.isfinite(v) else None for v in values]

    return {
        "log": result.log,
        "rows": result.rows,
        "relative_rms": plain(result.relative_rms),
        "relative_rms_period": plain(result.relative_rms_period),
        "rms": plain(result.rms),
        "verdict": result.verdict,
        "reasons": list(result.reasons),
    }


def save_identification(result: Identification, card: Card, path: Path) -> None:
    """Write an identification to `path` and a readable copy of its card beside it, as `write_with_card` does.

    Raises:
        FileFormatError: The file cannot be written.
    """
    structure = {
        "format": FORMAT,
        "robot": robot_record(result.model),
        "options": asdict(result.options),
        "rank": result.rank,
        "condition": result.condition,
        "training": [residual_record(r) for r in result.training],
        "tests": [residual_record(r) for r in result.tests],
        "friction": [asdict(part) for part in result.friction],
        "prior_weight": result.prior_weight,
        "moved_base": result.moved_base,
        "seen": None if result.seen is None else {k: v.tolist() for k, v in result.seen._asdict().items()},
    }
    arrays: dict[str, Any] = {
        "structure": np.array(json.dumps(structure)),
        "columns": result.base.columns,
        "combination": result.base.combination,
        "beta": result.beta,
        "covariance": result.covariance,
        "weights": result.weights,
    }
    if result.phi is not None:
        arrays["phi"] = result.phi
        arrays[IDENTIFIED] = np.array(json.dumps(robot_record(result.robot())))
    write_with_card(path, arrays, card)


def load_identification(path: Path) -> tuple[Identification, Card]:
    """Read an identification and its card.

    Raises:
        FileFormatError: No such file, not an identification, of another version, or damaged.
    """
    arrays = read_arrays(path)
    if not {"structure", "card", "beta", "combination"} <= set(arrays):
        raise FileFormatError(
            f"{path}: holds no identified parameters ({content_in_words(arrays)}); "
            "they are written by catenary identify"
        )
    try:
        found = json_table(str(arrays["structure"]), "structure")
        if found.get("format") != FORMAT:
            raise FileFormatError(f"format {shortened(found.get('format'))}, expected {FORMAT!r}")
        structure = parse_settings(found, IdentificationStructure, "structure")
        chosen = IdentifyOptions(**structure.options.model_dump())
        parameters = Parameters(robot_from_record(structure.robot), chosen.terms)
        b, k, n = len(arrays["beta"]), len(parameters.names), parameters.model.n
        shapes = {"combination": (b, k), "columns": (b,), "beta": (b,), "covariance": (b, b), "weights": (n,)}
        if "phi" in arrays:
            shapes["phi"] = (k,)
        for key, shape in shapes.items():
            if arrays[key].shape != shape or not np.isfinite(arrays[key]).all():
                raise ValueError(f"{key} has shape {arrays[key].shape}, expected {shape} of finite numbers")
        columns = arrays["columns"].astype(np.int64)
        if b == 0 or columns.min() < 0 or columns.max() >= k:
            raise ValueError(f"columns outside 0 to {k - 1}")
        result = Identification(
            base=BaseParameters(parameters, columns, arrays["combination"]),
            beta=arrays["beta"],
            covariance=arrays["covariance"],
            options=chosen,
            weights=arrays["weights"],
            rank=structure.rank,
            condition=structure.condition,
            training=tuple(_residual(entry) for entry in structure.training),
            tests=tuple(_residual(entry) for entry in structure.tests),
            phi=arrays.get("phi"),
            friction=tuple(FrictionPart(**part.model_dump()) for part in structure.friction),
            prior_weight=structure.prior_weight,
            moved_base=structure.moved_base,
            seen=_motion(structure.seen, n),
        )
        card = card_of(arrays, path, REMEDY)
        parse_settings(card, IdentificationCard, "card")
        return result, card
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, InputError) as error:
        raise FileFormatError(f"{path}: holds damaged parameters: {cut(repr(error))}") from error


def _motion(seen: MotionRecord | None, n: int) -> MovedRange | None:
    if seen is None:
        return None
    motion = MovedRange(np.array(seen.low), np.array(seen.high), np.array(seen.speed))
    if any(values.shape != (n,) or not np.isfinite(values).all() for values in motion):
        raise ValueError(f"seen: expected {n} finite numbers each")
    return motion


def _residual(entry: ResidualRecord) -> LogResidual:
    def numbers(values: Residuals) -> Floats:
        return np.array([np.nan if v is None else v for v in values], dtype=float)

    period = entry.relative_rms_period
    return LogResidual(
        entry.log, entry.rows, numbers(entry.rms), numbers(entry.relative_rms),
        None if period is None else numbers(period), entry.verdict, entry.reasons,
    )  # fmt: skip
