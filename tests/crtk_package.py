"""Write crtk_msgs as a package of ROS 2, of the definitions that catenary holds, or of all in a clone.

python -m tests.crtk_package FOLDER [CLONE]
"""

import sys
from pathlib import Path

from catenary.recording.messages import MESSAGES, SERVICES, full_definition

CMAKE = """cmake_minimum_required(VERSION 3.16)
project(crtk_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)
find_package(geometry_msgs REQUIRED)
rosidl_generate_interfaces(crtk_msgs {files} DEPENDENCIES std_msgs geometry_msgs)
ament_package()
"""
XML = """<package format="3"><name>crtk_msgs</name><version>1.3.0</version><description>as catenary has them</description>
<maintainer email="nobody@example.org">catenary</maintainer><license>MIT</license><buildtool_depend>ament_cmake</buildtool_depend>
<depend>std_msgs</depend><depend>geometry_msgs</depend><depend>rosidl_default_generators</depend>
<member_of_group>rosidl_interface_packages</member_of_group><export><build_type>ament_cmake</build_type></export></package>
"""


def definitions(clone: Path | None) -> dict[str, str]:
    """Return messages and services, by their places."""
    if clone is not None:
        return {f"{one.parent.name}/{one.name}": one.read_text() for one in clone.glob("*/*.[ms][sr][gv]")}
    files: dict[str, str] = {}
    for name in MESSAGES:
        if name.startswith("crtk_msgs/"):
            files[f"msg/{name.partition('/')[2]}.msg"] = full_definition(name).partition("\n===")[0]
    for name, (request, response) in SERVICES.items():
        if name.startswith("crtk_msgs/"):
            files[f"srv/{name.partition('/')[2]}.srv"] = f"{request}---\n{response}"
    return files


def write_package(folder: Path, files: dict[str, str]) -> None:
    """Write messages, services and what builds them."""
    files = files | {"package.xml": XML, "CMakeLists.txt": CMAKE.format(files=" ".join(sorted(files)))}
    for place, text in files.items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


if __name__ == "__main__":
    write_package(Path(sys.argv[1]), definitions(Path(sys.argv[2]) if len(sys.argv) > 2 else None))
