"""The sketch of docs/devices.md, built for this machine against a pretended Arduino, and listened to."""

import itertools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from catenary.devices.line_protocol import BoardSample, Hello, parse_line

PAGE = Path(__file__).parents[2] / "docs" / "devices.md"
# raw counts: 1 g up along z, 10 deg/s about x; time goes by a millisecond whenever it is asked for
ARDUINO = r"""
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
static unsigned long now_us = 4294000000UL;
unsigned long micros() { now_us = (now_us + 1000) & 0xFFFFFFFFUL; return now_us; }
unsigned long millis() { return micros() / 1000; }
void delay(int) {}
char *dtostrf(double v, int, int digits, char *out) { sprintf(out, "%.*f", digits, v); return out; }
struct { void begin(long) {} int available() { return 0; } int read() { return -1; }
         void print(char c) { putchar(c); } void print(const char *s) { fputs(s, stdout); } } Serial;
struct { int at = 0; void begin() {} void setClock(long) {} void beginTransmission(uint8_t) {} void write(uint8_t) {}
         int endTransmission(bool = true) { return 0; } int requestFrom(uint8_t, uint8_t n) { at = 0; return n; }
         int read() { static const int16_t raw[7] = {0, -8192, 16384, 0, 1310, 0, -131};
                      int k = at++; uint16_t v = (uint16_t)raw[k / 2]; return k % 2 ? v & 255 : v >> 8; } } Wire;
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler to build the sketch with")
def test_the_sketch_speaks_the_protocol(tmp_path):
    sketch = re.search(r"```text\n(#include <Wire.h>.*?)```", PAGE.read_text(), re.DOTALL)
    assert sketch is not None
    source = ARDUINO + sketch.group(1).replace("#include <Wire.h>", "")
    (tmp_path / "sketch.cpp").write_text(
        source + "int main() { setup(); for (int i = 0; i < 2000; i++) loop(); }\n"
    )
    subprocess.run(
        ["g++", "-Wall", "-Werror", "-o", tmp_path / "sketch", tmp_path / "sketch.cpp"], check=True
    )
    out = subprocess.run([tmp_path / "sketch"], capture_output=True, text=True, check=True).stdout
    lines = [parse_line(line) for line in out.split()]
    assert isinstance(lines[0], Hello)
    assert sum(isinstance(line, Hello) for line in lines) > 1
    samples = [line for line in lines if isinstance(line, BoardSample)]
    assert len(samples) > 300  # in 2000 rounds of at least 2 ms; the clock wraps after one second
    assert [s.number for s in samples] == list(range(len(samples)))
    assert samples[0].acceleration == pytest.approx((0.0, -0.5 * 9.80665, 9.80665), abs=1e-4)
    assert samples[0].rate == pytest.approx((10.0 * 0.0174533, 0.0, -0.0174533), abs=1e-4)
    steps = [(b.micros - a.micros) % 2**32 for a, b in itertools.pairwise(samples)]
    assert 9000 <= min(steps)
    assert max(steps) <= 13000
