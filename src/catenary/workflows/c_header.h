{# What c_header.py writes of a robot, its actuation and its calibration; lines and numbers come from there. #}
/* {{ what }}, written by catenary. C99 and C++11; needs math.h, takes no memory.
   Compile without -ffast-math. Angles in rad, lengths in m.
   Joints: {{ known | joints }}. */
#ifndef CATENARY_{{ name | upper }}_H
#define CATENARY_{{ name | upper }}_H

#include <math.h>
#include <stddef.h>

#define {{ name | upper }}_JOINTS {{ known.joint_names | length }}
{% if gravity %}
/* Gravity in m/s2 in the base frame{{ base }}, whose z points up on a level base: (0, 0, -9.81) there. */
#define {{ name | upper }}_PARAMETERS {{ 4 * links | length }}

{{ sines }}
/* Torques out[{{ n }}] [Nm, N] that hold the arm still at q[{{ n }}] under gravity[3]; never negate.
   {{ gravity.operations }} sums and products. To check: q = {{ at.q | values }}, gravity = {{ at.gravity | values }}
   gives {{ gravity_there | values }}. */
{{ function("gravity", gravity) }}
/* Regressor out[{{ n }} x {{ 4 * links | length }}], row by row: torques = out s; s holds, for each link, its mass
   [kg] and first moment about the origin of its frame [kg m]: m, mx, my, mz. Links:
   {{ links | map("comment") | join(", ") }}. {{ regressor.operations }} sums and products. */
{{ function("standard_gravity_regressor", regressor) }}
{% endif %}
{% if compact %}
#define {{ name | upper }}_COMPACT_PARAMETERS {{ compact.labels | length }}
/* Compact regressor out[{{ n }} x {{ compact.labels | length }}], row by row: torques = out s; s is without
   what no joint feels, and equal entries are one. {{ compact.line().operations }} sums and products. s:
{% for label in compact.labels %}
     {{ label | comment }} [{{ compact.units[loop.index0] }}]
{% endfor %}
   This robot's: {{ compact.parameters() | values }}. */
{{ function("compact_regressor", compact.line()) }}
{% endif %}
{% if motion %}
/* Mass matrix out[{{ n }} x {{ n }}] at q[{{ n }}], row by row; symmetric: kinetic energy is qd^T out qd / 2. Motors'
   inertia is not in it. {{ mass.operations }} sums and products. */
{{ function("mass_matrix", mass) }}
/* On a base that moves, all in its axes: omega[3] and alpha[3], its angular velocity and acceleration
   [rad/s, rad/s2]; gravity[3] is then free fall less the acceleration of the base's origin: what an
   accelerometer there reads, negated. omega and alpha may be NULL on a base that does not turn; no other array may. */

/* Torques out[{{ n }}] [Nm, N] that hold the arm still on such a base: the term of gravity, and of its turning.
   {{ holding.operations }} sums and products. */
{{ function("holding", holding) }}
/* Torques out[{{ n }}] [Nm, N] of a motion q[{{ n }}], qd[{{ n }}], qdd[{{ n }}] [rad, m, by s and s2] on such a base:
   M(q) qdd + C(q, qd) qd + g(q). {{ motion.operations }} sums and products. To check:
{% for array in ("q", "qd", "qdd", "gravity", "omega", "alpha") %}
     {{ array }} = {{ at[array] | values }}
{% endfor %}
   gives {{ motion_there | values }}. */
{{ function("inverse_dynamics", motion) }}
{% if loads %}
/* Friction: torques out[{{ n }}] [Nm, N] that it asks of the actuators at speeds qd[{{ n }}], as
   identified. {{ sliding }}.{% if loads.depends_on_load %} It grows with carried[{{ n }}], the torques of links and drives.{% endif %} */
{{ function("friction", friction) }}
/* Rotors, springs and known torques: torques out[{{ n }}] [Nm, N] beyond links and friction. All effects:
   {{ effects | comment }}. */
{{ function("drives", drives) }}
{% endif %}
/* The whole law in one call: the torques out [Nm, N] that a wanted motion q, qd, qdd asks of the actuators.
   {{ "Friction and drives are in it." if loads else "No friction is known of this robot." }} */
static inline void {{ name }}_feedforward(const double *q, const double *qd, const double *qdd, const double *gravity,
    const double *omega, const double *alpha, double *out) {
{% if loads %}
  double friction[{{ n }}], drives[{{ n }}];
  int k;
{% endif %}
  {{ name }}_inverse_dynamics(q, qd, qdd, gravity, omega, alpha, out);
{% if loads %}
  {{ name }}_drives(q, qdd, drives);
  for (k = 0; k < {{ n }}; ++k) out[k] += drives[k];
  {{ name }}_friction(qd, {{ "out, " if loads.depends_on_load }}friction);
  for (k = 0; k < {{ n }}; ++k) out[k] += friction[k];
{% endif %}
}

{% endif %}
{% if tool %}
/* Load out[6] [N, Nm] of the tool ({{ "%.4g" | format(tool.mass) }} kg) on its sensor, in the sensor's axes, in a motion
   q, qd, qdd of joints; zeros for qd and qdd leave its weight. */
{{ function("tool_load", tool_load) }}
/* What else acts on the tool: out[6], of reading[6] as the sensor gives it, less its bias, the load, and zero[6], that has
   drifted since the tool was weighed. */
static inline void {{ name }}_without_tool(const double *q, const double *qd, const double *qdd, const double *gravity,
    const double *reading, const double *zero, double *out) {
  static const double bias[6] = { {{- (tool.bias | values)[1:-1] -}} };
  int k;
  {{ name }}_tool_load(q, qd, qdd, gravity, out);
  for (k = 0; k < 6; ++k) out[k] = {{ tool.sign }} * (reading[k] - bias[k]) - zero[k] - out[k];
}

{% endif %}
{% if calibration %}
#define {{ name | upper }}_SIGNALS {{ signals | length }}
{% set count = calibration.joint_names | length %}
/* Calibrated positions of {{ calibration | joints }}, at {{ "%g" | format(rate_hz) }} Hz:
   one call a tick. q[{{ count }}]: reported positions; signals[{{ signals | length }}]: {{ signals | join(", ") }}.
   inside[{{ count }}]: 0 where the model is asked outside of what it has seen; a fixed offset is added there.
{% if slow %}
   Control that takes these positions must pass tau through a low-pass of {{ slow }} s; else it may diverge.
{% endif %}
{% if calibration.intervals %}
   ..._interval(state)[{{ count }}]: half-widths of the last tick's intervals, which hold {{ "%g" | format(100.0 * calibration.intervals.level) }} per cent of errors.
{% else %}
   The model has no intervals: ..._interval(state) gives NAN.
{% endif %}
   To check, after reset: q = {{ tick.q | values }}, signals = {{ tick.signals | values }}
   gives {{ tick.out | values }}, inside {{ tick.inside | values }}. */
{{ correction }}
{% endif %}
#endif /* CATENARY_{{ name | upper }}_H */
