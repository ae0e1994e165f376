"""Programs of Fast DDS alone (Debian's libfastrtps-dev), built once a session; skips, saying so, where it is missing."""

import shutil
import subprocess
from fcntl import LOCK_EX, flock
from hashlib import sha256
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "tests" / "oracles" / "fast_dds"
BUILT = ROOT / ".cache" / "fast_dds"


def build(name: str) -> Path:
    """The program of that name, compiled where its sources have changed."""
    if shutil.which("g++") is None or not Path("/usr/include/fastdds").is_dir():
        pytest.skip("Fast DDS is not installed: apt install g++ libfastrtps-dev")
    sources = sorted(SOURCES.iterdir())
    digest = sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    program = BUILT / f"{name}-{digest}"
    BUILT.mkdir(parents=True, exist_ok=True)
    with (BUILT / f"{name}.lock").open("w") as lock:  # workers begin together
        flock(lock, LOCK_EX)
        if not program.exists():
            making = program.with_suffix(".new")
            command = ["g++", "-O0", "-std=c++17", SOURCES / f"{name}.cpp", "-o", making, "-lfastrtps", "-lfastcdr"]
            subprocess.run(command, check=True)
            making.rename(program)
    return program


def run_client(domain: int, namespace: str, seconds: float = 300.0) -> list[str]:
    """What the client says that homes and moves an arm; it ends well, or that is in the last line."""
    ended = subprocess.run(
        [build("client"), str(domain), namespace], capture_output=True, text=True, timeout=seconds, check=False
    )
    return ended.stdout.splitlines()


class FastPeer:
    """The program that is told by lines what to do."""

    def __init__(self, domain: int) -> None:
        self.process = subprocess.Popen(
            [build("peer"), str(domain)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.seen: list[str] = []
        assert self.line("ready") == "ready"

    def __enter__(self) -> "FastPeer":
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self.process.communicate(timeout=20.0)  # it ends with its input, and tells the others
        finally:
            self.process.kill()

    def tell(self, *words: object) -> None:
        """Give it a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()

    def line(self, beginning: str) -> str:
        """The next line that begins so; others before it are kept in `seen`."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.seen.append(line.strip())
            if line.startswith(beginning):
                return line.strip()
        raise AssertionError(f"the program ended; it said {self.seen}")
