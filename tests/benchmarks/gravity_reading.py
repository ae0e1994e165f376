"""Processor time of reading gravity 1,000 times a second, sensor at 200 Hz: python -m tests.benchmarks.gravity_reading [SECONDS]."""

import gc
import sys
import time

import numpy as np

from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from oracles.shaken_imu import Shaken, X, Y, rock

MINUTE, PLACE = 60.0, (0.1, 0.0, 0.2)


def durations(seconds):
    """Return the processor time of each tick [us], with new samples or without, and whether it had them."""
    t, _, force, rates = Shaken(((X, rock(10.0, 0.3)), (Y, rock(5.0, 1.0))), place=PLACE).samples(MINUTE, 3)
    mailbox = Mailbox()
    source, taken = SensedGravity(mailbox, Mounting(position=np.array(PLACE))), []
    for begin in np.arange(0.0, seconds, MINUTE).tolist():
        k = 0
        for tick in range(round(1000.0 * min(MINUTE, seconds - begin))):
            now, before = tick / 1000.0, k
            while k < len(t) and t[k] <= now:
                mailbox.put(begin + t[k], rates[k], Kind.ANGULAR_RATE)
                mailbox.put(begin + t[k], force[k], Kind.SPECIFIC_FORCE)
                k += 1
            start = time.thread_time_ns()
            source.read(begin + now)
            taken.append(((time.thread_time_ns() - start) / 1000.0, k > before))
    return np.array(taken).T


if __name__ == "__main__":
    gc.disable()
    took, sampled = durations(float(sys.argv[1]) if len(sys.argv) > 1 else MINUTE)
    quantiles = ", ".join(f"{q:g} %: {np.percentile(took, q):.1f}" for q in (50, 99, 99.9, 99.99, 100))
    print(
        f"{len(took)} ticks, mean {took.mean():.1f} us, without samples {took[sampled == 0.0].mean():.1f}; {quantiles} us"
    )
