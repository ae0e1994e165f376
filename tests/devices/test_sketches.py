"""Sketches of boards, built for this machine against a pretended Arduino, and listened to."""

import itertools
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from catenary.devices.accelerometer import BoardSample, Hello, parse_line
from catenary.devices.encoder_board import CountTracker, EncoderRig, Verdict, parse_counts

BOARDS = Path(__file__).parents[2] / "examples" / "boards"
# raw counts: 1 g up along z, 10 deg/s about x; time goes by a millisecond whenever it is asked for
WIRE = r"""
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
    source = WIRE + (BOARDS / "mpu6050.ino").read_text().replace("#include <Wire.h>", "")
    (tmp_path / "sketch.cpp").write_text(source + "int main() { setup(); for (int i = 0; i < 2000; i++) loop(); }\n")
    subprocess.run(["g++", "-Wall", "-Werror", "-o", tmp_path / "sketch", tmp_path / "sketch.cpp"], check=True)
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


# three LS7366R by their data sheet: opcode and register in the first byte; the counters go on while nobody reads
SPI = r"""
#include <cstdint>
#include <cstdio>
#define LOW 0
#define HIGH 1
#define OUTPUT 1
#define MSBFIRST 1
#define SPI_MODE0 0
static unsigned long now_us = 4294000000UL;
static int selected = -1, at = 0, command = 0;
static int32_t counter[3] = {7, 7, 7}, output[3];
static uint8_t mode_0[3], mode_1[3];
unsigned long micros() {
  now_us = (now_us + 500) & 0xFFFFFFFFUL;
  counter[0] += 3; counter[1] -= 5; counter[2] += 1;
  return now_us;
}
void pinMode(int, int) {}
void digitalWrite(int pin, int level) { if (level == LOW) { selected = pin - 8; at = 0; } else selected = -1; }
struct SPISettings { SPISettings(long, int, int) {} };
struct { void begin() {} void beginTransaction(SPISettings) {} void endTransaction() {}
  uint8_t transfer(uint8_t value) {
    int k = selected, n = at++;
    if (n == 0) {
      command = value;
      int op = value >> 6, place = (value >> 3) & 7;
      if (op == 0 && place == 4) counter[k] = 0;
      if (op == 3 && place == 5) output[k] = counter[k];
      return 0;
    }
    int op = command >> 6, place = (command >> 3) & 7;
    if (op == 2 && place == 1) mode_0[k] = value;
    if (op == 2 && place == 2) mode_1[k] = value;
    if (op == 1 && place == 5) return (uint8_t)((uint32_t)output[k] >> (8 * (4 - n)));
    return 0;
  } } SPI;
struct { void begin(long) {} void print(const char *s) { fputs(s, stdout); } } Serial;
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler to build the sketch with")
def test_the_sketch_sends_rows_that_the_driver_believes(tmp_path: Path) -> None:
    source = SPI + (BOARDS / "three_ls7366r.ino").read_text().replace("#include <SPI.h>", "")
    end = "int main() { setup(); for (int i = 0; i < 8000; i++) loop(); return !(mode_0[2] == 3 && mode_1[1] == 0); }\n"
    (tmp_path / "sketch.cpp").write_text(source + end)
    built = tmp_path / "sketch"
    subprocess.run(["g++", "-Wall", "-Werror", "-o", built, tmp_path / "sketch.cpp"], check=True)
    ended = subprocess.run([built], capture_output=True, text=True, check=True)
    rows = np.array([parse_counts(line) for line in ended.stdout.split()])
    assert len(rows) > 300
    steps = np.diff(rows, axis=0)
    # whatever was cleared began at nothing and went on in the chips' own steps: 20 of 0.5 ms a row, across the clock's end
    assert np.abs(rows[0]).max() <= 5 * 25
    assert (steps == np.array([3, -5, 1]) * (steps[:, 2:])).all()
    assert 18 <= steps[:, 2].min()
    assert steps[:, 2].max() <= 22
    tracker = CountTracker(EncoderRig())
    assert {tracker.update(tuple(row), 0.01 * k).verdict for k, row in enumerate(rows.tolist())} == {Verdict.GOOD}
