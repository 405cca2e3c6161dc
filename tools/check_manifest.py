# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Check package.xml: well-formed by xmllint where it is there, and accepted by catkin_pkg."""

from pathlib import Path
import shutil
import subprocess
import sys
from xml.etree import ElementTree

from catkin_pkg.package import InvalidPackage, parse_package


def problems(manifest: Path) -> list[str]:
    """List what is wrong with a manifest; warnings count."""
    xmllint = shutil.which('xmllint')
    if xmllint:
        check = subprocess.run(
            [xmllint, '--noout', '--nonet', manifest], capture_output=True, text=True, check=False
        )
        if check.returncode:
            return check.stderr.splitlines()
    else:
        print('no xmllint here: package.xml is parsed by Python alone')
        try:
            ElementTree.parse(manifest)
        except ElementTree.ParseError as error:
            return [f'{manifest}: {error}']
    found: list[str] = []
    try:
        package = parse_package(manifest, warnings=found)
    except InvalidPackage as error:
        return [*found, str(error)]
    if package.get_build_type() != 'ament_python':
        found.append(f'{manifest}: the build type is {package.get_build_type()}')
    return found


if __name__ == '__main__':
    wrong = problems(Path(sys.argv[1]))
    print('\n'.join(wrong) if wrong else f'{sys.argv[1]}: no problems')
    sys.exit(1 if wrong else 0)
