"""Fuzz the readers of bytes guided by coverage: `python -m tests.campaign.guided READER --seconds 300`.

Needs Atheris: `pip install atheris` (3.0, wheels for Linux), which nothing else does. READER is journal, bag (ROS 1,
from its beginning), mcap, messages (of all topics, as they come over ROS 1) or model (.npz). An input is read to its end
or refused by a CatenaryError; another exception, a crash, 5 s or 1 GB end the run, and the input is kept in DIR/READER.
Inputs that reach new code are kept in DIR/READER/corpus: the next run goes on from them.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

MEMORY = 1500  # [MB] of the process with its imports, which take some 500


def main() -> None:
    """Fuzz one reader; Atheris ends the process."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaign.guided", description=__doc__)
    parser.add_argument("reader", choices=sorted(READERS))
    parser.add_argument("--seconds", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("build/campaign/guided"))
    options = parser.parse_args()
    try:
        import atheris
    except ImportError as error:
        raise SystemExit(f"{error}: pip install atheris") from error
    os.environ["NUMBA_DISABLE_JIT"] = "1"  # code that counts its branches is not numba's
    with atheris.instrument_imports(
        include=["catenary.recording", "catenary.crtk", "catenary.calibration", "rosbags"]
    ):
        samples, read = READERS[options.reader]()
    out = options.out / options.reader
    corpus = out / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for number, sample in enumerate(samples):
        (corpus / f"sample-{number}").write_bytes(sample)
    from catenary.errors import CatenaryError

    def one_input(data: bytes) -> None:
        try:
            read(data)
        except CatenaryError:
            return

    limits = [
        f"-max_total_time={options.seconds}",
        "-timeout=5",
        f"-rss_limit_mb={MEMORY}",
        "-max_len=100000",
    ]
    atheris.Setup(
        [sys.argv[0], *limits, f"-artifact_prefix={out}/", "-print_final_stats=1", str(corpus)], one_input
    )
    atheris.Fuzz()


Reader = tuple[list[bytes], Callable[[bytes], object]]  # what to begin from, and what reads bytes


def _of_files(name: str, samples: list[bytes], read: Callable[[Path], object]) -> Reader:
    path = Path(tempfile.mkdtemp(prefix="guided-")) / name

    def read_bytes(data: bytes) -> None:
        path.write_bytes(data)
        read(path)

    return samples, read_bytes


def _journal() -> Reader:
    from catenary.recording.journal_reader import JournalReader
    from tests.campaign.parts import byte_files

    return _of_files(
        "0000.mcap", [byte_files._journal()[0]], lambda path: list(JournalReader(path).messages())
    )


def _bag() -> Reader:
    from catenary.recording.bag_stream import BagStream
    from tests.campaign.parts import byte_files

    return _of_files("a.bag", [byte_files._bag("")[0]], lambda path: list(BagStream(path).messages()))


def _mcap() -> Reader:
    from catenary.recording.bag_stream import BagStream
    from tests.campaign.parts import byte_files

    return _of_files("a.mcap", [byte_files._mcap(False)[0]], lambda path: list(BagStream(path).messages()))


def _model() -> Reader:
    from catenary.calibration.files import load_model
    from tests.campaign.parts import archive_files

    return _of_files("model.npz", [archive_files._model()], load_model)


def _messages() -> Reader:
    import numpy as np

    from catenary.crtk.codec import codec
    from catenary.crtk.names import topics
    from oracles.random_messages import random_message

    names = sorted({topic.type for dialect in ("raven", "crtk") for topic in topics(dialect)})  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    samples = [bytes([k]) + codec(name).encode(random_message(name, rng), 0) for k, name in enumerate(names)]

    def read(data: bytes) -> None:
        """The first byte chooses the type."""
        if data:
            one = codec(names[data[0] % len(names)])
            one.encode(one.decode(data[1:]), 0)

    return samples, read


READERS: dict[str, Callable[[], Reader]] = {
    "journal": _journal,
    "bag": _bag,
    "mcap": _mcap,
    "messages": _messages,
    "model": _model,
}

if __name__ == "__main__":
    main()
