"""
Build gear_rattle_ros: with colcon the executables of `ros2 run`, with pip one command.

colcon calls `install` or `develop`, which setup.cfg makes put every executable into
lib/gear_rattle_ros. pip builds a wheel instead: of it come the command `gear_rattle` in bin/ and,
for `ros2 run`, a launcher for every executable in lib/gear_rattle_ros.
"""

# After setuptools, which brings its own copy where Python has none any more.
from distutils.command.install_data import install_data  # noqa: I100
from pathlib import Path
import runpy
import xml.etree.ElementTree as ElementTree

from setuptools import Distribution, find_packages, setup

PACKAGE = 'gear_rattle_ros'

# The one table of executables; that module needs nothing but the standard library.
EXECUTABLES = runpy.run_path(f'{PACKAGE}/start.py')['EXECUTABLES']

# Started through the kernel by its full path, it hands over to pip's own script, which knows the
# environment's python; exec, so that a signal reaches the node itself.
LAUNCHER = '#!/bin/sh\nexec "${0%/*}/../../bin/gear_rattle" "${0##*/}" "$@"\n'


class Package(Distribution):
    """A distribution whose scripts suit the command, and whose data an editable install brings."""

    def parse_command_line(self):
        """Choose the scripts once the command is known."""
        go_on = super().parse_command_line()
        of_colcon = {'develop', 'install'} & set(self.commands)
        self.entry_points = {'console_scripts': [
            f'{name} = {PACKAGE}.start:{name}'
            for name in (EXECUTABLES if of_colcon else ['gear_rattle'])]}
        return go_on

    def has_data(self):
        """Answer what setuptools asks under this name before an editable install of the data."""
        return self.has_data_files()


class InstallData(install_data):
    """Install the data files and, with pip, the launchers that `ros2 run` looks for."""

    def run(self):
        """Copy the data files, then write the launchers."""
        super().run()
        scripts = Path(self.get_finalized_command('install_scripts').install_dir)
        if scripts.parts[-2:] == ('lib', PACKAGE):
            return
        folder = Path(self.install_dir, 'lib', PACKAGE)
        self.mkpath(str(folder))
        for name in EXECUTABLES:
            launcher = folder / name
            self.execute(launcher.write_text, (LAUNCHER,), f'writing {launcher}')
            launcher.chmod(0o755)
            self.outfiles.append(str(launcher))


def data_files():
    """List what goes to share/: the ament marker, package.xml, config/ and the launch files."""
    files = {
        'share/ament_index/resource_index/packages': [f'resource/{PACKAGE}'],
        f'share/{PACKAGE}': ['package.xml'],
    }
    for path in sorted(Path('config').rglob('*')):
        if path.is_file():
            below = path.parent.relative_to('config')
            kept = below if below.parts[:1] == ('launch',) else Path('config', below)
            files.setdefault(f'share/{PACKAGE}/{kept.as_posix()}', []).append(path.as_posix())
    return sorted(files.items())


manifest = ElementTree.parse('package.xml').getroot()
readme = Path('README.md')
# colcon --symlink-install builds elsewhere, with links to this file and the data files alone.
requirements = Path(__file__).resolve().with_name('requirements.txt')

setup(
    name=PACKAGE,
    version=manifest.findtext('version'),
    description='Gear rattling as a live laboratory on ROS 2',
    long_description=readme.read_text(encoding='utf-8') if readme.exists() else '',
    long_description_content_type='text/markdown',
    license=manifest.findtext('license'),
    url=manifest.findtext('url'),
    author=manifest.findtext('author'),
    author_email=manifest.find('author').get('email'),
    maintainer=manifest.findtext('maintainer'),
    maintainer_email=manifest.find('maintainer').get('email'),
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    data_files=data_files(),
    python_requires='>=3.11',
    install_requires=requirements.read_text(encoding='utf-8').splitlines(),
    # A ROS installation brings rclpy and the messages: the wheels of them are an extra.
    extras_require={
        'cluster': [
            'distributed',
        ],
        'parquet': [
            'pyarrow',
        ],
        'ros': [
            'ros-jazzy-common-interfaces',
            'ros-jazzy-rclpy',
            'ros-jazzy-rmw-fastrtps-cpp',
        ],
        'doc': [
            'furo',
            'latex2mathml',
            'myst-nb',
            'sphinx',
        ],
        'test': [
            'catkin-pkg',
            'colcon-core',
            'colcon-package-information',
            'colcon-python-setup-py',
            'colcon-recursive-crawl',
            'colcon-ros',
            'cyclonedds; python_version < "3.14"',
            'distributed',
            'hypothesis',
            'import-linter',
            'mpmath',
            'playwright',
            'pyarrow',
            'pytest',
            'pytest-xdist',
            'rosbags',
            'scipy',
            'setuptools>=70.1,<80',
        ],
        # flake8 with the plugins of ament_flake8, whose wheel stops at Python 3.11.
        'lint': [
            'ament-lint-pep257',
            'catkin-pkg',
            'flake8',
            'flake8-builtins',
            'flake8-class-newline',
            'flake8-comprehensions',
            'flake8-deprecated',
            'flake8-docstrings',
            'flake8-import-order',
            'import-linter',
            'mypy',
            'ruff',
            'types-pyyaml',
        ],
    },
    distclass=Package,
    cmdclass={'install_data': InstallData},
    zip_safe=False,
)
