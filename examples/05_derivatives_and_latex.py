"""Take an arm's dynamics elsewhere: formulas by SymPy, derivatives and batches by JAX, an MPC's model by CasADi.

Prints the gravity torques of a two-link arm as formulas, how stiff gravity makes a RAVEN-II (its derivative), the
torques of a thousand poses at once, and the names that a CasADi function of the inverse dynamics takes.
Needs `pip install jax casadi sympy`.
"""

import casadi
import jax
import numpy as np
import sympy

import catenary

jax.config.update("jax_enable_x64", True)  # torques need float64

formulas = catenary.export_function(catenary.load_robot("two_link"), "gravity", "sympy")
print("two links hold against gravity, in N m:")
print(formulas)
print("the same for LaTeX:", sympy.latex(formulas.result)[:60], "...")

arm = catenary.load_robot("raven2")
q, gravity = np.array([0.5, 1.6, 0.4]), np.array([0.0, 0.0, -9.81])
torque = catenary.export_function(arm, "gravity", "jax")
stiffness = jax.jacfwd(torque)(q, gravity)
print("\nRAVEN-II: dg/dq is symmetric, as gravity has a potential:")
print(np.array(stiffness).round(4))

poses = np.random.default_rng(0).uniform(arm.lower, arm.upper, size=(1000, arm.n))
batch = jax.vmap(torque, in_axes=(0, None))(poses, gravity)
print("largest torques of a thousand poses:", np.abs(np.array(batch)).max(axis=0).round(3))

dynamics = catenary.export_function(arm, "inverse_dynamics", "casadi")
acceleration = casadi.SX.sym("qdd", arm.n)
held = dynamics(q=q, qdd=acceleration, gravity=gravity)["tau"]
print("\nCasADi:", dynamics)
print("tau of RAVEN-II at rest, by acceleration:", casadi.jacobian(held, acceleration).shape, "matrix, its mass matrix")
