"""catenary teleop on a pseudo-terminal, typed to."""

import json
import os
import pty
import select
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from typing import Any

from patience import PATIENCE, until


class Typist:
    """The real command, or a program like it, on a pseudo-terminal."""

    def __init__(
        self,
        *arguments: str,
        program: tuple[str, ...] = ("-m", "catenary.cli.main"),
        environment: dict[str, str] | None = None,
    ) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        command = [sys.executable, *program, "teleop", "--json", *arguments]
        self.process = subprocess.Popen(
            command, stdin=self.slave, stdout=self.slave, stderr=subprocess.PIPE, env=environment
        )
        self.seen = b""

    def __enter__(self) -> "Typist":
        return self

    def __exit__(self, *exception: object) -> None:
        self.process.kill()
        self.process.communicate()
        os.close(self.master)
        os.close(self.slave)

    def type(self, key: bytes, times: int = 1, every: float = 0.04) -> None:
        """Press a key, and hold it as a terminal does."""
        for _ in range(times):
            os.write(self.master, key)
            time.sleep(every)

    def hold(self, key: bytes, so: Callable[[], object]) -> None:
        """Hold a key until something is so."""

        def is_so() -> object:
            os.write(self.master, key)
            self._read(0.0)
            return so()

        until(is_so, every=0.04)

    def wait_for(self, text: bytes, seconds: float = 4.0 * PATIENCE) -> None:
        """Read until something was shown; what is compiled before takes minutes on a machine that is busy."""
        end = time.monotonic() + seconds
        while text not in self.seen:
            assert time.monotonic() < end, self.seen[-2000:]
            self._read(0.1)

    def _read(self, seconds: float) -> None:
        if select.select([self.master], [], [], seconds)[0]:
            self.seen += os.read(self.master, 65536)

    def end(self) -> dict[str, Any]:
        """Wait for its end with exit code 0; give the JSON that it printed then."""
        self.wait_for(b'"state"')
        self.wait_for(b"\n}")
        assert self.process.wait(PATIENCE) == 0
        content: dict[str, Any] = json.loads(self.seen[self.seen.rindex(b"\x1b[?1049l") + 8 :])
        return content
