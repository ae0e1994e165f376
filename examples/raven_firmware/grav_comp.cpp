/* Gravity compensation of the RAVEN-II by catenary's exported model, in place of the robot's src/raven/grav_comp.cpp.

   Same entry point, same fields: getGravityTorque() puts into joint[SHOULDER, ELBOW, Z_INS].tau_g of each arm what its
   motors have to give at the gearbox's output [Nm] so that the links stay where they are. Masses and centres of mass
   are in the headers, which are made anew whenever the model changes:

     catenary export raven2 --c raven2.h                the gold arm
     catenary export raven2_right --c raven2_right.h    the green arm

   Compiles from C++98 on. No memory is taken, nothing is read but the arguments. */

#include "grav_comp.h" /* the robot's own */

#include "raven2.h"
#include "raven2_right.h"

extern int NUM_MECH;

/* Gravity [m/s2] in the base's axes, z up, from the robot's integers [cm/s2].

   grav_dir is (0, 0, 980) on a level base: its z points down, and its axes are the base's turned by 180 deg about y.
   The robot's code takes it on to frame 0 of each arm, by (-z, x, -y) for gold and (-z, -x, y) for green. These two
   frames 0 lie differently in the one base, so both are the same vector there. */
static void baseGravity(const device &d0, double gravity[3]) {
  gravity[0] = -d0.grav_dir.x / 100.0;
  gravity[1] = d0.grav_dir.y / 100.0;
  gravity[2] = -d0.grav_dir.z / 100.0;
}

/* Torques tau[3] [Nm, Nm, N] at the joints of arm m that hold its links against gravity, positive as the joint is. */
void getJointGravity(const device &d0, int m, double tau[3]) {
  const mechanism &arm = d0.mech[m];
  const double q[3] = {arm.joint[SHOULDER].jpos, arm.joint[ELBOW].jpos, arm.joint[Z_INS].jpos}; /* rad, rad, m */
  double gravity[3];
  baseGravity(d0, gravity);
  if (arm.type == GOLD_ARM) {
    raven2_gravity(q, gravity, tau);
  } else {
    raven2_right_gravity(q, gravity, tau);
  }
}

/* Write the gravity torques of both arms where control reads them. Called once a cycle. */
void getGravityTorque(device &d0, param_pass &params) {
  (void)params;
  for (int m = 0; m < NUM_MECH; ++m) {
    double tau[3];
    getJointGravity(d0, m, tau);
    DOF *joint = d0.mech[m].joint;
    /* from the joint to the gearbox's output, each by its own ratio: as the robot does, the cables' coupling aside */
    joint[SHOULDER].tau_g = static_cast<float>(tau[0] / SHOULDER_TR_GOLD_ARM * GEAR_BOX_GP42_TR);
    joint[ELBOW].tau_g = static_cast<float>(tau[1] / ELBOW_TR_GOLD_ARM * GEAR_BOX_GP42_TR);
    joint[Z_INS].tau_g = static_cast<float>(tau[2] / Z_INS_TR_GOLD_ARM * GEAR_BOX_GP42_TR);
  }
}
