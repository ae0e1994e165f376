"""Fit, evaluate and plot a calibration of positions in arrays.

The arrays are two joints whose cables stretch and slip. Prints the RMS errors per joint on motion that the model did
not see, and writes errors.png: the error of each joint before and after.
"""

import matplotlib.pyplot as plt
import numpy as np

import catenary

t = np.linspace(0.0, 60.0, 3000)
q = np.column_stack([np.sin(t) + 0.3 * np.sin(2.3 * t), 0.1 * np.cos(1.7 * t)])
truth = q + np.column_stack([0.02 + 0.01 * q[:, 0] * q[:, 1], 0.002 * np.sign(np.cos(t))])

model = catenary.fit(q[:2000], truth[:2000], units=["rad", "m"], model="polynomial")
errors = model.evaluate(q[2000:], truth[2000:])
print(errors)
figure, rows = plt.subplots(2, sharex=True)
for joint, axes in enumerate(rows):
    axes.plot(errors.raw[:, joint], label="reported")
    axes.plot(errors.after_model[:, joint], label="calibrated")
    axes.set_ylabel(f"{model.joint_names[joint]} [{model.joint_units[joint]}]")
rows[0].legend()
figure.savefig("errors.png")
