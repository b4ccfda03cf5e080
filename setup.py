# SPDX-License-Identifier: Apache-2.0
"""Build ros_pad with colcon (``ament_python``) or with pip."""

import os
from glob import glob

from setuptools import find_packages
from setuptools import setup

NAME = 'ros_pad'
NODES = ['body_estimator', 'controller', 'estimator', 'recorder', 'regulator', 'simulator']
DOCS = ['furo>=2024.8', 'myst-parser>=4.0', 'sphinx>=8.1']


def shared_files() -> list[tuple[str, list[str]]]:
    """Return what goes under ``share/``: ament's marker, package.xml, launch/, all of config/."""
    files = [
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', glob('launch/*.launch.py')),
    ]
    for folder, _, _ in os.walk('config'):
        files.append((f'share/{NAME}/{folder}', sorted(glob(f'{folder}/*.*'))))
    return files


def ros(distribution: str) -> list[str]:
    """Return the wheels of a ROS 2 distribution that the nodes need."""
    packages = [
        'rclpy[fastrtps]',
        'ament-index-python',
        'builtin-interfaces',
        'diagnostic-msgs',
        'geometry-msgs',
        'lifecycle-msgs',
        'nav-msgs',
        'rcl-interfaces',
        'rosgraph-msgs',
        'sensor-msgs',
        'std-msgs',
        'std-srvs',
        'visualization-msgs',
    ]
    return [f'ros-{distribution}-{package}' for package in packages]


setup(
    name=NAME,
    version='0.2.0',
    description='Shape-changing feet for legged robots on ROS 2: model, simulation, nodes',
    license='Apache-2.0',
    maintainer='ros_pad maintainers',
    maintainer_email='ros-pad@example.org',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    data_files=shared_files(),
    zip_safe=False,
    python_requires='>=3.11',
    # The lower bounds are the versions of Ubuntu 24.04, on which a Jazzy from apt runs; mcap,
    # which it does not have, writes to disk on request from 1.5 on.
    install_requires=[
        'argcomplete>=3.1',
        'numpy>=1.26',
        'scipy>=1.11',
        'matplotlib>=3.6',
        'pyyaml>=6.0',
        'tqdm>=4.66',
        'mcap>=1.5',
        'rosbags>=0.11',
        'pyserial>=3.5',
    ],
    extras_require={
        # ROS 2 as wheels; leave these extras out where ROS is installed from apt.
        'ros': ros('jazzy'),
        'kilted': ros('kilted'),
        # The hexapod with joints (L2), and compiled loops of the planar one.
        'mujoco': ['mujoco>=3.3.6'],
        'fast': ['numba>=0.60'],
        # Sweeps on a Dask cluster, and Parquet beside their CSV.
        'sweep': ['distributed>=2024.1', 'pyarrow>=14'],
        # Meshes of pads from STL, OBJ, PLY and MSH files.
        'mesh': ['meshio>=5.3'],
        # `pad explore`: pads designed in the browser.
        'explore': ['nicegui>=3.0', 'starlette>=0.40'],
        # The site: `make docs`.
        'docs': DOCS,
        # ruff and mypy change their verdicts between minor versions, so these are pinned.
        'test': [
            'colcon-common-extensions',
            'distributed>=2024.1',
            'h5py',
            'hypothesis',
            'mcap-ros2-support',
            'meshio>=5.3',
            'mpmath>=1.2',
            'mujoco>=3.3.6',
            'mypy==2.4.*',
            'nicegui>=3.0',
            'numba>=0.60',
            'playwright>=1.49',
            'pyarrow>=14',
            'pytest>=7.4',
            'pytest-xdist',
            'ruff==0.17.*',
            'scikit-fem>=9',
            'types-PyYAML',
            *DOCS,
        ],
    },
    entry_points={
        'console_scripts': [
            'pad = ros_pad.__main__:main',
            *(f'{node}_node = ros_pad.nodes.start:{node}' for node in NODES),
        ],
    },
)
