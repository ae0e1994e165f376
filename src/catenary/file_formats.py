"""Every format of files that is read, written or only known: its names, how its files begin, and what reads them.

A format is one record here, and all else reads it: what opens a recording, what `check`, `import` and `recover` do with
a file, what no command overwrites. A new one is its reader and its record; the contract test fails until it has an
example.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from catenary.errors import imported


@dataclass(frozen=True)
class FileFormat:
    """A format of files, and all that the package asks about it."""

    name: str  # in words
    # what its reader returns: of "columns" streams, of "messages" a bag; robots and models have readers of their own
    holds: Literal["columns", "messages", "robot", "other", "nothing read"] = "other"
    endings: tuple[str, ...] = ()  # of names, in small letters
    folder: str | None = None  # of one that is a folder: the file in it that tells it, "" if any folder may be one
    marks: tuple[tuple[int, bytes], ...] = ()  # one of which a file holds: place [B] and bytes
    trusts_mark: bool = False  # whatever its name ends in
    is_text: bool = False
    reader: str = ""  # MODULE:NAME below catenary.recording, of path and, where it has episodes, the name of one
    reader_in_parts: str = ""  # of long files, of path and a progress callback
    has_episodes: bool = False  # FILE/EPISODE is one of several recordings in it
    has_layouts: bool = False  # catenary knows layouts of such files, which need no mapping
    package: str = ""  # without which it is not read, of the extra that brings it
    extra: str = ""
    advice: str = ""  # what else to do with one, where nothing reads it or the package is missing

    @property
    def ending(self) -> str:
        """The first of its endings, by which code tells it; empty if it has none."""
        return self.endings[0] if self.endings else ""

    def reads(self, path: Path, reader: str = "") -> Callable[..., Any]:
        """Return the reader of this format, imported at its first use."""
        if self.package:
            imported(self.package, f"{path}: is {self.name}, which needs {self.package} (or {self.advice})", self.extra)
        module, _, name = (reader or self.reader).partition(":")
        read: Callable[..., Any] = getattr(import_module(f"catenary.recording.{module}"), name)
        return read


_TABLES, _TEXT = "import_formats.table_files", "import_formats.csv_files:TextTable"
UNKNOWN = FileFormat("of no known format", "nothing read")
_MOTIVE = b"Format Version"
FORMATS = (
    FileFormat("a ROS 1 bag", "messages", (".bag", ".bag.active"), marks=((0, b"#ROSBAG V2.0\n"),),
               reader="bag_stream:BagStream"),
    FileFormat("MCAP", "messages", (".mcap",), marks=((0, b"\x89MCAP0\r\n"),), reader="bag_stream:BagStream"),
    FileFormat("SQLite of a ROS 2 bag", "messages", (".db3",), marks=((0, b"SQLite format 3\0"),),
               reader="bag_reader:SqliteBag"),
    FileFormat("HDF5", "columns", (".hdf5", ".h5"), trusts_mark=True, has_episodes=True,
               marks=((0, b"\x89HDF\r\n\x1a\n"), (512, b"\x89HDF\r\n\x1a\n")),  # the second as MATLAB writes it
               reader="import_formats.episode_files:read_hdf5", package="h5py", extra="hdf5",
               advice="save its arrays as .npz, or in MATLAB save('log.mat', '-v7')"),
    FileFormat("Motive's export", "columns", marks=((0, _MOTIVE), (0, b"\xef\xbb\xbf" + _MOTIVE)), trusts_mark=True,
               is_text=True, reader=f"{_TABLES}:read_tracker_file"),
    FileFormat("CSV", "columns", (".csv",), is_text=True, has_layouts=True, reader=f"{_TABLES}:read_text",
               reader_in_parts=_TEXT),
    FileFormat("a table of text", "columns", (".txt", ".tsv", ".dat", ".asc"), is_text=True,
               reader=f"{_TABLES}:read_text", reader_in_parts=_TEXT),
    FileFormat("Parquet", "columns", (".parquet",), marks=((0, b"PAR1"),), has_layouts=True,
               reader=f"{_TABLES}:read_parquet_table"),
    FileFormat("NumPy's archive of arrays", "columns", (".npz",), marks=((0, b"PK\x03\x04"),), has_layouts=True,
               reader=f"{_TABLES}:read_numpy"),
    FileFormat("NumPy's array", "columns", (".npy",), marks=((0, b"\x93NUMPY"),), reader=f"{_TABLES}:read_numpy"),
    FileFormat("MATLAB up to version 7", "columns", (".mat",), reader=f"{_TABLES}:read_matlab"),
    FileFormat("a table that gzip packed", "columns", (".gz",), marks=((0, b"\x1f\x8b"),),
               reader=f"{_TABLES}:read_gzip_table"),
    FileFormat("a dataset of LeRobot", "columns", folder="meta/info.json", has_episodes=True,
               reader="import_formats.episode_files:read_lerobot"),
    FileFormat("a ROS 2 bag", "messages", folder="metadata.yaml", reader="bag_reader:open_recording"),
    FileFormat("a journal, or bags in a folder", "messages", folder="", reader="bag_reader:open_recording"),
    # robots' files, read by `robots.catalog`
    FileFormat("a robot's table in TOML", "robot", (".toml",), is_text=True),
    FileFormat("URDF", "robot", (".urdf", ".xacro"), is_text=True),
    FileFormat("URDF or MJCF", "robot", (".xml", ".mjcf"), is_text=True),
    FileFormat("a robot's file of the dVRK", "robot", (".json",), is_text=True),
    # what commands write, other programs read, and no name of another kind may end in
    FileFormat("YAML", endings=(".yaml", ".yml"), is_text=True),
    FileFormat("C", endings=(".h", ".c"), is_text=True),
    FileFormat("Python", endings=(".py",), is_text=True),
    FileFormat("a page", endings=(".html", ".htm"), is_text=True),
    FileFormat("text", endings=(".md",), is_text=True),
    FileFormat("a picture", endings=(".png", ".svg", ".pdf")),
    # what people have and nothing reads: what to do
    FileFormat("a spreadsheet", "nothing read", (".xlsx", ".xlsm", ".xls", ".ods"),
               advice="save its sheet as CSV (Save As, CSV UTF-8)"),
    FileFormat("packed", "nothing read", (".zip", ".7z", ".rar", ".tar", ".tgz", ".xz", ".bz2", ".zst"),
               advice="unpack it first"),
    FileFormat("a pickle, which may run code", "nothing read", (".pkl", ".pickle", ".pt", ".pth", ".joblib"),
               advice="where you trust it, load it in Python and write arrays by numpy.savez"),
    FileFormat("Arrow's", "nothing read", (".feather", ".arrow"),
               advice="pandas.read_feather(...).to_parquet(...) writes Parquet"),
    FileFormat("LabVIEW's", "nothing read", (".tdms",),
               advice="nptdms.TdmsFile(...).as_dataframe().to_csv(...) writes a CSV"),
    FileFormat("PX4's", "nothing read", (".ulg",), advice="ulog2csv writes a CSV a topic"),
)  # fmt: skip


def format_named(path: Path) -> FileFormat:
    """Return the format that a name's ending tells."""
    return next((form for form in FORMATS if path.name.lower().endswith(form.endings)), UNKNOWN)


def format_of(path: Path) -> FileFormat:
    """Return the format of a file or folder: by its first bytes where these tell it surely, its name, else its bytes.

    A model or log may be written under any name (`--out arm`). A file that cannot be opened has the format of its name.
    """
    if path.is_dir():
        folders = (form for form in FORMATS if form.folder is not None)
        return next(form for form in folders if not form.folder or (path / form.folder).is_file())
    begin, named = _begin(path), format_named(path)
    marked = [form for form in FORMATS if any(begin.startswith(mark, place) for place, mark in form.marks)]
    sure = [form for form in marked if form.trusts_mark or named is UNKNOWN]
    return sure[0] if sure else named


def endings(holds: str) -> tuple[str, ...]:
    """Return the endings of all formats that hold such."""
    return tuple(ending for form in FORMATS if form.holds == holds for ending in form.endings)


def copied_as_text(path: Path | str) -> str:
    """Return a hint that a text-mode transfer changed a binary file's line ends; empty if it did not."""
    begin = _begin(path, 2**20) if isinstance(path, Path) else b""
    for mark in (mark for form in FORMATS if not form.is_text for _, mark in form.marks):
        head = re.split(rb"[\r\n]", mark, maxsplit=1)[0]  # a transfer as text changes what follows
        if not begin.startswith(head):
            continue
        following, lines = begin.removeprefix(head), begin.count(b"\n")
        in_mark = following.lstrip(b"\r").startswith(b"\n") and not begin.startswith(mark)
        if in_mark or (head == mark and 0 < lines == begin.count(b"\r\n")):
            return "; it was copied as text, which changes bytes (line ends): copy it again in binary mode"
    return ""


def _begin(path: Path, size: int = 520) -> bytes:
    """Return a file's first bytes; none if it is none, or cannot be opened."""
    try:
        if path.is_file():
            with path.open("rb") as file:
                return file.read(size)
    except (OSError, ValueError):  # ValueError: a name with a zero byte
        pass
    return b""
