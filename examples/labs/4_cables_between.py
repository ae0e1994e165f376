"""Lab 4: where a joint is that a cable moves.

Ninety minutes, no robot. The motors of a RAVEN-II sit at its base and their encoders with them; cables lead to the
joints, stretch, rub and go slack. You correct the elbow of a simulated one from a recording with a second encoder at
the joint. Where a line says `...` your formula is missing; the line below checks it, and says what is wrong as far as
that can be told.
"""

# ## 1. How wrong is it? (15 minutes)
#
# Two recordings of the same arm: a zig-zag on Monday, a random motion on Tuesday. `reported` is the elbow that the
# robot believes in, `true` the one that the second encoder reads, both (N,) in rad. Write the root mean square of an
# error.

import matplotlib.pyplot as plt
import numpy as np
from checks import check_direction, check_line, check_rms, check_test, simulated_days

import catenary

monday, tuesday = simulated_days()
ELBOW = 1


def rms(error):
    return ...  # [rad], of error (N,) [rad]


print(check_rms(rms))

# ## 2. The best line (20 minutes)
#
# Find slope and offset of `true = slope * reported + offset`, by least squares.


def line(reported, true):
    return [..., ...]  # slope, offset [rad]


print(check_line(line))

# ## 3. On what will you be tested? (15 minutes)
#
# You tell your group that the arm is now so and so many degrees wrong. It will be used for other motions, on other
# days. Choose the rows that the line is fitted to, and those that its error is computed from: "monday", "tuesday", or
# "monday, every other row".

trained_on, tested_on = ..., ...

print(check_test(trained_on, tested_on))

# ## 4. The cable remembers (40 minutes)
#
# Draw the error that the line leaves over the position: going up it is another than going down. A cable that rubs pulls
# against the motion, whatever the speed. So there is a third column beside position and one: write it, from times (N,)
# [s] and reported positions (N,) [rad]. It holds the direction: about +1 on the way up, -1 on the way down.


def direction(time, reported):
    return ...  # (N,)


print(check_direction(direction))

# Compare. `catenary.fit` has a state for each width of slack, loads, cables that run over other joints' drums, and
# intervals: what does it see that your three columns do not? Where does it help less than you would expect?


def corrected(columns):
    """Fit the true elbow to columns on Monday, and return the RMS error on Tuesday [deg]."""
    weights = np.linalg.lstsq(columns(monday), monday.q_encoder[:, ELBOW], rcond=None)[0]
    return np.rad2deg(np.sqrt(np.mean((columns(tuesday) @ weights - tuesday.q_encoder[:, ELBOW]) ** 2)))


def straight(log):
    return np.column_stack([log.q_nominal[:, ELBOW], np.ones(len(log))])


def remembering(log):
    return np.column_stack([straight(log), direction(log.time, log.q_nominal[:, ELBOW])])


errors = {"reported": np.rad2deg(np.sqrt(np.mean((tuesday.q_nominal - tuesday.q_encoder)[:, ELBOW] ** 2)))}
errors["line"] = corrected(straight)
if direction(monday.time, monday.q_nominal[:, ELBOW]) is not ...:
    errors["line and direction"] = corrected(remembering)
errors["catenary.fit"] = catenary.fit(monday).evaluate(tuesday).joints[ELBOW].rmse
for name, error in errors.items():
    print(f"{name:20} {error:.3f} deg")
weights = np.linalg.lstsq(straight(monday), monday.q_encoder[:, ELBOW], rcond=None)[0]
left = np.rad2deg(monday.q_encoder[:, ELBOW] - straight(monday) @ weights)
figure, axes = plt.subplots()
axes.plot(np.rad2deg(monday.q_nominal[:, ELBOW]), left, ".", markersize=1)
axes.set(xlabel="reported elbow [deg]", ylabel="error that a line leaves [deg]")
figure.savefig("elbow.png")
