from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from catenary.calibration.model_file import save_model
from catenary.plant import MotionLog
from dds import Network as Domain
from meeting import Meeting, taking_part
from recordings import fitted


@pytest.fixture(scope="module", params=["1", "2"], ids=["ros1", "dds"])
def meeting(request: pytest.FixtureRequest) -> Iterator[Meeting]:
    """Over ROS 1, then over DDS; this process takes part."""
    if request.param == "1":
        network = request.getfixturevalue("ros_master")
    else:
        network = Domain(request.getfixturevalue("dds_domain"))
    with taking_part(request.param):
        yield Meeting(network, request.param)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Adds a hundredth to each joint, wherever it is."""
    q = np.random.default_rng(0).uniform([0.0, 1.0, 0.2], [1.2, 2.2, 0.5], (400, 3))
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    log = MotionLog("run", names, units, q, np.ones(400, dtype=bool), q + 0.01, time=np.arange(400) / 30.0)
    path = tmp_path_factory.mktemp("model") / "arm.npz"
    save_model(fitted(log, kind="linear", inputs=tuple(f"q:{name}" for name in names)), {}, path)
    return path
