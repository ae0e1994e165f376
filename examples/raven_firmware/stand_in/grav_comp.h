/* STAND-IN, to compile and try ../grav_comp.cpp without a robot. Not the robot's header: of its structs only the fields
   that gravity compensation uses, by their public names and types; of its constants the values that they come to.
   On the robot, include/raven/grav_comp.h and what it includes take this file's place. */
#ifndef RAVEN_STAND_IN_H
#define RAVEN_STAND_IN_H

#define SHOULDER 0
#define ELBOW 1
#define Z_INS 2
#define MAX_DOF_PER_MECH 8
#define MAX_MECH_PER_DEV 2
#define GREEN_ARM 22
#define GOLD_ARM 49

/* turns of a motor's shaft per joint [rad/rad, rad/rad, rad/m], and per turn of its gearbox's output */
#define SHOULDER_TR_GOLD_ARM 136.1963
#define ELBOW_TR_GOLD_ARM 121.5221
#define Z_INS_TR_GOLD_ARM 2158.590
#define GEAR_BOX_GP42_TR (49.0 / 4.0)

struct position {
  int x;
  int y;
  int z;
};

struct DOF {
  float jpos;
  float tau_g;
};

struct mechanism {
  unsigned short type;
  DOF joint[MAX_DOF_PER_MECH];
};

struct robot_device {
  mechanism mech[MAX_MECH_PER_DEV];
  position grav_dir;
};

struct param_pass {
  position grav_dir;
};

typedef robot_device device;

void getGravityTorque(device &d0, param_pass &params);

#endif
