"""A served robot, and a client that knows neither catenary nor Python: Fast DDS alone."""

import numpy as np
import pytest

from dds import Network
from fast_dds import build, run_client
from ros import COMMAND, Program

STEPS = ["connected", "enabled", "homed", "moved", "servoed"]


@pytest.mark.slow
def test_a_client_of_fast_dds_homes_moves_and_reads_a_served_psm() -> None:
    build("client")
    network = Network()
    with Program(network, COMMAND, "serve", "--ros", "2", "--robot", "dvrk_psm", "--json") as server:
        server.line()
        said = run_client(network.domain, "/PSM1")
        server.interrupt()
        _, errors = server.finish()
    assert said[: len(STEPS)] == STEPS
    assert said[-1] == "disabled"
    goal, measured, tip = (np.array(line.split()[1:], dtype=float) for line in said[-4:-1])
    # its own controller has no integral: the arm's weight shows
    np.testing.assert_allclose(measured[:2], goal[:2], atol=np.deg2rad(1.5))
    np.testing.assert_allclose(measured[2], goal[2], atol=1e-3)
    assert 0.01 < np.linalg.norm(tip) < 0.5
    assert "Traceback" not in errors
