"""A JointState between this package and a program of Cyclone DDS's C library, both ways; idlc makes its type."""

import shutil
import subprocess
import time
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import header, message_class
from dds import NODE

ROOT = Path(__file__).parents[3]
SOURCES = ROOT / "tests" / "oracles" / "cyclone_c"
TYPE, TOPIC = "sensor_msgs/JointState", "/arm1/measured_js"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program, compiled where its sources have changed."""
    if None in map(shutil.which, ("gcc", "idlc")) or not Path("/usr/include/dds/dds.h").is_file():
        pytest.skip("Cyclone DDS for C is not installed: apt install gcc cyclonedds-dev cyclonedds-tools")
    digest = sha256(b"".join(path.read_bytes() for path in sorted(SOURCES.iterdir()))).hexdigest()[:16]
    built = ROOT / ".cache" / "cyclone_c" / f"peer-{digest}"
    if not built.exists():
        folder = tmp_path_factory.mktemp("cyclone_c")
        subprocess.run(["idlc", "-l", "c", SOURCES / "joint_state.idl"], cwd=folder, check=True)
        command = ["gcc", "-I.", SOURCES / "peer.c", "joint_state.c", "-o", "peer", "-lddsc"]
        subprocess.run(command, cwd=folder, check=True)
        built.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / "peer", built.with_suffix(".new"))
        built.with_suffix(".new").rename(built)
    return built


def started(program: Path, verb: str, domain: int) -> subprocess.Popen[str]:
    return subprocess.Popen([program, verb, str(domain), f"rt{TOPIC}"], stdout=subprocess.PIPE, text=True)


def test_c_reads_what_this_package_writes(program: Path, dds_domain: int) -> None:
    with DdsTransport(NODE) as transport, started(program, "take", dds_domain) as other:
        publisher = transport.publisher(TOPIC, TYPE)
        message = message_class(TYPE)(
            header(7 * 10**9 + 11, "base"), ("a", "bc"), np.array([0.1, -3.0]), (), np.array([1e-9, 2.0])
        )
        end = time.monotonic() + 30.0
        while not transport.connections(TOPIC).subscribers and time.monotonic() < end:
            time.sleep(0.01)
        publisher.publish(message)
        said, _ = other.communicate(timeout=40.0)
    assert said.splitlines() == [
        "ready",
        f"stamp=7.000000011 frame=base name=a,bc position={0.1:.17g},-3 velocity effort={1e-9:.17g},2",
    ]


def test_this_package_reads_what_c_writes(program: Path, dds_domain: int) -> None:
    with DdsTransport(NODE) as transport:
        heard = transport.subscribe(TOPIC, TYPE)
        with started(program, "send", dds_domain) as other:
            said, _ = other.communicate(timeout=60.0)
        assert (said, other.returncode) == ("sent\n", 0)
        end = time.monotonic() + 10.0
        while not len(heard) and time.monotonic() < end:
            time.sleep(0.01)
        ((message, _),) = heard.take()
    assert message.header[1:] == (3 * 10**9 + 5, "base")
    assert message.name == ("shoulder", "elbow")
    assert [values.tolist() for values in message[2:]] == [[1.5, -2.0], [], [0.25, 0.5]]
