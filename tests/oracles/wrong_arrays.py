"""What is no contiguous, aligned array of three numbers of 64 bits, each in one way."""

import numpy as np

WRONG_ARRAYS = (
    np.zeros(2),
    np.zeros(4),
    np.zeros((3, 1)),
    np.zeros(()),
    np.zeros(3, dtype=np.float32),
    np.zeros(3, dtype=np.int64),
    np.zeros(3, dtype=np.complex128),
    np.zeros(6)[::2],
    np.zeros(3).astype(">f8"),
    np.frombuffer(bytes(25), dtype=np.float64, count=3, offset=1),  # not aligned
    np.zeros(3).view(np.recarray),
    [0.0, 0.0, 0.0],
    1.0,
    None,
)
