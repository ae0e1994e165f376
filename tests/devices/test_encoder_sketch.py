"""The encoder board's sketch of docs/devices.md, built for this machine against pretended chips, and listened to."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from catenary.devices.encoder_counts import CountTracker, Verdict, parse_counts
from catenary.devices.encoder_rig import EncoderRig

PAGE = Path(__file__).parents[2] / "docs" / "devices.md"
# three LS7366R by their data sheet: opcode and register in the first byte; the counters go on while nobody reads
ARDUINO = r"""
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
    sketch = re.search(r"```text\n(#include <SPI.h>.*?)```", PAGE.read_text(), re.DOTALL)
    assert sketch is not None
    source = ARDUINO + sketch.group(1).replace("#include <SPI.h>", "")
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
    assert {tracker.update(tuple(row), 0.01 * k).verdict for k, row in enumerate(rows.tolist())} == {
        Verdict.GOOD
    }
