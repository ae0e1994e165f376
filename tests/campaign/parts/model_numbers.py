"""Calibration models of which one number was changed: refused, or never valid with a correction beyond the bound.

Half of the files keep the card that was written with them, and must be refused. The others get a card with the new
SHA-256, as from somebody who changes a file on purpose: what is then still loaded gives no correction beyond REACH times
the largest that training showed, by rows, by ticks and in a loop, and the arm in that loop stays as near.
"""

import json
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaign.part import Fell, Part

if TYPE_CHECKING:
    from catenary.calibration.calibration import Calibration

KINDS: tuple[dict[str, Any], ...] = (
    {"model": "offset"},
    {"model": "linear"},
    {"model": "linear", "target": "position", "history": 2},
    {"model": "polynomial"},
    {"model": "linear", "play": (0.1, 0.3)},
    {"model": "neural", "preset": "paper"},
)
SECONDS = 2.0  # a correction has come on by then


@cache
def _motion() -> Any:
    t = np.arange(0.0, 20.0, 0.02)
    q = np.sin(np.outer(t, [0.7, 1.1])) * [0.8, 0.5]
    return t, q, q + [0.02, -0.05] + 0.03 * q + 0.02 * q**2


@cache
def _fitted(number: int) -> "tuple[Path, Calibration]":
    from dataclasses import replace

    import catenary
    from catenary.calibration import fit_rows
    from catenary.calibration.neural import PAPER

    fit_rows.PAPER = replace(PAPER, hidden=(8, 8), epochs=40)  # how well it learns is not asked
    t, q, truth = _motion()
    folds = 2 if number % 2 else 0  # with intervals, and without
    model = catenary.fit(q, truth, units=("rad", "rad"), joint_names=("j0", "j1"), time=t, folds=folds, **KINDS[number])
    path = Path(tempfile.mkdtemp(prefix="campaign-sample-")) / "model.npz"
    model.save(path)
    return path, catenary.load_model(path)


def _other(rng: np.random.Generator, value: float) -> float:
    """Return another number: a multiple, one of any size, or one of its bits turned."""
    way = rng.integers(3)
    if way == 0:
        return float(value * rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 9.0))
    if way == 1:
        return float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 12.0))
    bits = np.array([value]).view(np.uint64) ^ (np.uint64(1) << np.uint64(rng.integers(64)))
    return float(bits.view(np.float64)[0])


def numbers(seed: int, folder: Path) -> None:
    """Change one number of a model."""
    from catenary.calibration.model_file import load_model
    from catenary.cards import SEAL, sha256_of_arrays
    from catenary.errors import CatenaryError

    rng = np.random.default_rng(seed)
    whole, before = _fitted(seed % len(KINDS))
    arrays = dict(np.load(whole))
    name = str(rng.choice([key for key in sorted(arrays) if arrays[key].dtype.kind == "f" and arrays[key].size]))
    place = int(rng.integers(arrays[name].size))
    old = float(arrays[name].flat[place])
    arrays[name].flat[place] = new = _other(rng, old)
    sealed = bool(rng.integers(2))
    if sealed:
        arrays["card"] = np.array(json.dumps(json.loads(str(arrays["card"])) | {SEAL: sha256_of_arrays(arrays)}))
    path = folder / "model.npz"
    np.savez(path, **arrays)
    (folder / "change.txt").write_text(f"{name}[{place}]: {old} -> {new}, sealed {sealed}\n")
    try:
        model, _ = load_model(path)
    except CatenaryError:
        return
    if not sealed and np.array(old).tobytes() != np.array(new).tobytes():
        raise Fell(f"{name}[{place}] {old} -> {new}: loaded under the card of other numbers")
    _check(model, before.largest)


def _check(model: Any, largest: np.ndarray) -> None:
    """Hold a model against the largest corrections (n,) that its training showed."""
    from catenary.calibration.corrector import Corrector
    from catenary.calibration.model import REACH
    from catenary.control.loop import run_loop
    from catenary.control.pd import JointPD
    from catenary.trajectories.reference import Rest
    from tests.oracles.ideal_plant import MassPlant

    _, q, _ = _motion()
    rate = 50.0
    for rows in (q, 1.3 * q):
        with np.errstate(all="ignore"):
            out, inside = Corrector(model, rate_hz=rate).run(rows, rows)
        correction, bound = out - rows, REACH * largest + 1e-9
        if not (np.abs(correction) <= bound).all():
            raise Fell(f"a correction of {np.abs(correction).max(axis=0)}, expected at most {bound}")
        if not np.allclose(correction[~inside], np.broadcast_to(model.offset, q.shape)[~inside], atol=1e-12):
            raise Fell("what is not valid is not the fixed offset")
    here = q[100]
    plant = MassPlant(here)
    moved = np.zeros(2)

    def observe(tick: Any) -> None:
        np.maximum(moved, np.abs(tick.q_nominal - here), out=moved)

    loop = Corrector(model, decimation=20)
    run_loop(plant, JointPD([400.0] * 2, [40.0] * 2), Rest(here, SECONDS), corrector=loop, observers=[observe])
    # the arm goes to where the controller takes it to be, and a critically damped one no farther
    if not (moved <= REACH * largest * 1.01 + 1e-6).all():
        raise Fell(f"an arm at rest moved by {moved}, expected at most {REACH * largest}")


PARTS = (Part("models.numbers", 2000, numbers, processor_time=20.0),)
