# SPDX-License-Identifier: Apache-2.0
"""Build ros_pad with colcon (``ament_python``) or with pip."""

import os
import pathlib
import re
import xml.etree.ElementTree
from glob import glob

from setuptools import find_packages, setup

# Of the source, also where colcon runs a link to this file in its own folder.
ROOT = pathlib.Path(os.path.realpath(__file__)).parent
PACKAGE = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()
URLS = {each.get('type'): each.text for each in PACKAGE.iter('url')}
NAME = 'ros_pad'
NODES = [
    'body_estimator', 'controller', 'estimator', 'merge', 'recorder', 'regulator', 'simulator',
    'views',
]  # fmt: skip
DOCS = ['furo>=2024.8', 'matplotlib>=3.6', 'myst-parser>=4.0', 'sphinx>=8.1']


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


def long_description() -> str:
    """Return the README for an index page, which has neither the pages nor the pictures."""
    place = rf'\g<0>{URLS["repository"]}'
    text = (ROOT / 'README.md').read_text(encoding='utf-8')
    text = re.sub(r'!\[[^]]*\]\((?!\w+:)', f'{place}/raw/main/', text)
    return re.sub(r'(?<!!)\[[^]]*\]\((?!\w+:|#)', f'{place}/blob/main/', text)


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
    version=PACKAGE.findtext('version'),
    description='Shape-changing feet for legged robots on ROS 2: model, simulation, nodes',
    long_description=long_description(),
    long_description_content_type='text/markdown',
    license=PACKAGE.findtext('license'),
    maintainer=PACKAGE.findtext('maintainer'),
    maintainer_email=PACKAGE.find('maintainer').get('email'),
    project_urls={
        'Documentation': URLS['website'],
        'Source': URLS['repository'],
        'Issues': URLS['bugtracker'],
        'Changelog': f'{URLS["repository"]}/blob/main/CHANGELOG.md',
    },
    keywords='legged robot, soft robotics, foot, contact, friction, slip, estimation, ROS 2',
    classifiers=[
        'Development Status :: 3 - Alpha',
        'Environment :: Console',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        *(f'Programming Language :: Python :: 3.{minor}' for minor in (11, 12, 13)),
        'Topic :: Scientific/Engineering :: Physics',
        'Typing :: Typed',
    ],
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed']},
    data_files=shared_files(),
    zip_safe=False,
    python_requires='>=3.11',
    # The lower bounds are the versions of Ubuntu 24.04, on which a Jazzy from apt runs; mcap,
    # which it does not have, writes to disk on request from 1.5 on.
    install_requires=[
        'numpy>=1.26',
        'scipy>=1.11',
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
        # Pictures and reports.
        'plot': ['matplotlib>=3.6'],
        # The hexapod with joints (L2), and compiled loops of the planar one.
        'mujoco': ['mujoco>=3.3.6'],
        'fast': ['numba>=0.60'],
        # Sweeps on a Dask cluster, and Parquet beside their CSV.
        'sweep': ['distributed>=2024.1', 'pyarrow>=14'],
        # Meshes of pads from STL, OBJ, PLY and MSH files.
        'mesh': ['meshio>=5.3'],
        # `pad mould`: moulds of a foot, with their drawing.
        'make': ['manifold3d>=3.0', 'matplotlib>=3.6'],
        # `pad explore`: pads designed in the browser.
        'explore': ['matplotlib>=3.6', 'nicegui>=3.0', 'starlette>=0.40'],
        # The site: `make docs`.
        'docs': DOCS,
        # ruff and mypy change their verdicts between minor versions, so these are pinned.
        'test': [
            'colcon-common-extensions',
            'distributed>=2024.1',
            'h5py',
            'hypothesis',
            'manifold3d>=3.0',
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
            'setuptools>=77',
            'trimesh>=4',
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
