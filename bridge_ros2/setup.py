"""Installs the package as a ROS 2 package. Colcon runs this file; pip is not needed."""

from glob import glob
from xml.etree import ElementTree

from setuptools import setup

NAME = "mjplug_bridge_ros2"
# ROS 2 reads the version from package.xml.
VERSION = ElementTree.parse("package.xml").findtext("version")

setup(
    name=NAME,
    version=VERSION,
    description="Maps the topics and services of an mjplug simulation server to ROS 2, with any RMW.",
    license="Apache-2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*.yaml")),
    ],
    install_requires=["setuptools"],
    entry_points={"console_scripts": [f"bridge = {NAME}.main:main"]},
    zip_safe=True,
)
