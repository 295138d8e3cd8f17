from setuptools import setup

NAME = "rso_lidar_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/lidar.launch.py"]),
    ],
    install_requires=["setuptools"],
    maintainer="rso_lidar",
    maintainer_email="rso_lidar@example.org",
    description="A node that flies a scenario of rso_lidar and publishes what the lidar and the other sensors measure.",
    license="MIT",
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
