"""What colcon installs: the node, and where ROS looks for its launch file and parameters."""

from setuptools import setup

NAME = "vrscan_driver"

setup(
    name=NAME,
    version="0.1.0",
    description="Publishes the points of a VR-SCAN board as PointCloud2 and LaserScan.",
    license="Apache-2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", ["config/vrscan.yaml"]),
        (f"share/{NAME}/launch", ["launch/vrscan.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    entry_points={"console_scripts": [f"{NAME} = {NAME}.node:main"]},
)
