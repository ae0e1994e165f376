"""The robots that come with the package and have inertia: the others load for kinematics and identification alone."""

from catenary.robots.catalog import load_robot, robot_names


def robots_with_inertia() -> list[str]:
    """Names, sorted."""
    return [name for name in robot_names() if not load_robot(name).missing_inertia]
