"""Models, logs and states in NumPy's archives whose bytes were damaged: read, or refused by a CatenaryError."""

import io
import random
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

from tests.campaign.byte_part import files_part, linear_model, sample
from tests.campaign.mutants import mutant, same_length


def _repacked(rng: random.Random, whole: bytes) -> bytes:
    """Return an archive with one member damaged, or gone, and all checksums right."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive, zipfile.ZipFile(out, "w") as damaged:
        names = archive.namelist()
        hit = rng.choice(names)
        for name in names:
            data = archive.read(name)
            if name == hit:
                if rng.random() < 0.1:
                    continue
                begin = 10 + int.from_bytes(data[8:10], "little")
                part = rng.random()
                if part < 0.3:
                    data = mutant(rng, data[:begin]) + data[begin:]
                elif part < 0.6:
                    data = data[:begin] + same_length(rng, data[begin:])
                else:
                    data = mutant(rng, data)
            damaged.writestr(name, data)
    return out.getvalue()


def _archive_case(name: str, whole: Callable[[], bytes], read: Callable[[Path], object]) -> Callable[[int, Path], None]:
    def case(seed: int, folder: Path) -> None:
        rng = random.Random(seed)
        content = whole()
        path = folder / name
        places = tuple(
            (i + at, size)
            for i in range(len(content) - 46)
            if content.startswith(b"PK\x01\x02", i)
            for at, size in ((10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (30, 2), (32, 2), (42, 4))
        )
        path.write_bytes(_repacked(rng, content) if rng.random() < 0.6 else mutant(rng, content, places))
        read(path)

    return case


def _load_model(path: Path) -> None:
    from catenary.calibration.model_file import load_model

    load_model(path)


@cache
def _command_log() -> bytes:
    import numpy as np

    buffer = io.BytesIO()
    q = np.cumsum(np.random.default_rng(1).normal(size=(200, 3)), axis=0)
    np.savez(
        buffer, q_des=q, q_act=q + 1, ok=np.ones(200, dtype=bool), t=np.arange(200.0), units=np.array(["rad"] * 3),
        joint_names=np.array(["a", "b", "c"]),
    )  # fmt: skip
    return buffer.getvalue()


def _read_command_log(path: Path) -> None:
    from catenary.recording.logs import read_log

    read_log(path)


@cache
def _plant_state() -> bytes:
    from catenary.simulation.plant_state import save_plant

    path = sample("state.npz")
    save_plant(_plant(), path)
    return path.read_bytes()


@cache
def _plant():  # type: ignore[no-untyped-def]
    from catenary.simulation.cable_plant import CablePlant

    return CablePlant(seed=1)


def _restore_plant(path: Path) -> None:
    from catenary.simulation.plant_state import restore_plant

    restore_plant(_plant(), path)


PARTS = (
    files_part("model_npz", _archive_case("model.npz", linear_model, _load_model)),
    files_part("log_npz", _archive_case("log.npz", _command_log, _read_command_log)),
    files_part("robot_state_npz", _archive_case("state.npz", _plant_state, _restore_plant)),
)
