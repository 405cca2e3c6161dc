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

"""What a node makes of its command line: nothing is passed over in silence."""

from importlib.metadata import version
import os
from pathlib import Path

import pytest
from rclpy.utilities import try_shutdown

from gear_rattle_ros.nodes.base.arguments import (
    misspelt_sections,
    refuse_large_files,
    refuse_plain,
    split_arguments,
)
from gear_rattle_ros.nodes.base.errors import UserError
from gear_rattle_ros.nodes.base.node import BaseNode
from gear_rattle_ros.nodes.base.process import begin
from gear_rattle_ros.parameters import TABLES


@pytest.mark.parametrize('given, plain, ros', [
    ([], [], []),
    (['bag', '--loop'], ['bag', '--loop'], []),
    (['a', '--ros-args', '-r', 'x:=y', '--', 'b'], ['a', 'b'], ['--ros-args', '-r', 'x:=y', '--']),
    (['--ros-args', '--ros-args', '-p', 'a:=1'], [], ['--ros-args', '--ros-args', '-p', 'a:=1']),
    (['--', 'b'], ['--', 'b'], []),
])
def test_arguments_are_split_as_ros_does(given: list[str], plain: list[str],
                                         ros: list[str]) -> None:
    """What ROS would leave is plain."""
    assert split_arguments(given) == (plain, ros)


@pytest.mark.parametrize('words, hint', [
    (['--rate', '5'], '-p rate:=VALUE'), (['--rate=5'], '-p rate:=VALUE'),
    (['--initial-phase', '1'], '-p initial_phase:=VALUE'), (['alhpa:=1'], '-p alpha:=VALUE'),
    (['xyzzy'], 'NAME one of alpha, beta')])
def test_plain_arguments_are_refused_with_a_remedy(words: list[str], hint: str) -> None:
    """One line names the argument and how parameters are given."""
    with pytest.raises(ValueError) as caught:
        refuse_plain('simulator', words)
    assert repr(words[0]) in str(caught.value) and hint in str(caught.value)
    assert '\n' not in str(caught.value)


def test_misspelt_sections_of_parameter_files_are_named(tmp_path: Path) -> None:
    """Only by the node that is nearest; other nodes' sections and patterns are their own."""
    file = tmp_path / 'p.yaml'
    file.write_text(
        '/**/simulatr: {ros__parameters: {alpha: 1.0}}\nrviz2: {}\n/**: {}\nsimulator: {}\n')
    ros = ['--ros-args', '--params-file', str(file)]
    assert list(misspelt_sections('simulator', ros)) == [
        f"{file}: section '/**/simulatr' belongs to no node; did you mean 'simulator'?"]
    assert not list(misspelt_sections('lyapunov', ros))
    file.write_text('a: {b: {simulatr: {ros__parameters: {}}}, ros_parameters: {c: {d: 1}}}\n')
    assert [line.split(':')[1] for line in misspelt_sections('simulator', ros)] == [
        " section 'simulatr' belongs to no node; did you mean 'simulator'?"]
    file.write_text('simulator\n')
    line, = misspelt_sections('simulator', ros)
    assert "'simulator' is not a section and is ignored; it must read NODE: {ros__par" in line
    for text in ('[1, 2', '- 1', '', '5: {}', '\x00'):
        file.write_text(text)
        assert not list(misspelt_sections('simulator', ros))
    assert not list(misspelt_sections('simulator', ['--params-file', '/nowhere']))
    assert list(misspelt_sections('simulator', ['-p', 'simulatr:alpha:=1', '-p', 'beta:=1'])) == [
        "-p 'simulatr:alpha:=1': there is no node 'simulatr'; did you mean 'simulator'?"]


def taken(ros: list[str]) -> str:
    """Return how a node refuses its arguments before it runs, or nothing where it takes them."""
    node = None
    try:
        begin(['--ros-args', *ros])
        node = BaseNode('lyapunov')
    except (UserError, ValueError) as error:
        return str(error)
    finally:
        if node is not None:
            node.destroy_node()
        try_shutdown()
    return ''


SECTION = 'lyapunov: {ros__parameters: {%s}}'
BAD_FILES = {
    # Of the wrong type or range.
    SECTION % 'publish_rate: "1.0"': "publish_rate = '1.0' is not of type double",
    SECTION % 'publish_rate: [1.0, 2.0]': 'publish_rate = [1.0, 2.0] is not of type double',
    SECTION % 'publish_rate: true': 'publish_rate = True is not of type double',
    SECTION % 'publish_rate: []': "'publish_rate' has no value",
    SECTION % 'publish_rate: {}': "'publish_rate' has no value",
    SECTION % 'publish_rate: .nan': 'publish_rate = nan is not a number',
    SECTION % 'publish_rate: -.inf': 'publish_rate = -inf is outside [0.1, 1000]',
    SECTION % 'publish_rate: 1e999': "publish_rate = '1e999' is not of type double",
    SECTION % f'publish_rate: {2**64}': 'publish_rate = 1.8446744073709552e+19 is outside',
    SECTION % f'window: {2**63}': 'window = 9.223372036854776e+18 is not of type integer',
    SECTION % f'window: {-2**63}': 'window = -9223372036854775808 is outside [1, 1e+06]',
    SECTION % f'window: {"x" * 5000}': f"window = '{'x' * 76}... is not of type integer",
    # What rcl does not take: with what is wrong where that can be said, and the form.
    SECTION % 'publish_rate: [1, 2.0]': "Value type 'double' do not belong at line_num 1; it",
    SECTION % 'publish_rate: ': 'No value at line 1; it must read NODE: {ros__parameters:',
    SECTION % 'publish_rate: *a': 'is not YAML: found undefined alias',
    SECTION % ('publish_rate: ' + '[' * 10_000): 'is not YAML: RecursionError; it must read',
    'lyapunov: {publish_rate: 5.0}': 'Cannot have a value before ros__parameters at line 1; it',
    'lyapunov: {ros_parameters: {window: 5}}': 'Cannot have a value before ros__parameters at',
    'ros__parameters: {window: 5}': 'There are no node names before ros__parameters at line 1;',
    'lyapunov: {ros__parameters: [1]}': 'Cannot have a value before ros__parameters at line 1;',
    '- 1': 'Sequences cannot be key at line 1; it must read',
    'lyapunov:\n\tros__parameters: {}': 'is not YAML: while scanning for the next token found',
    b'lyapunov: {ros__parameters: {}} # \xff': 'byte 34 is not UTF-8; it must read',
    b'\x00': 'is not YAML: unacceptable character #x0000',
    'a' * 200_000: 'has 200000 bytes; at most 100000 are read',
}


def test_parameter_files_that_are_none(tmp_path: Path, capfd) -> None:
    """One line each that names the file or the value; rcl itself prints nothing."""
    file = tmp_path / 'p.yaml'
    for content, words in BAD_FILES.items():
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        line = taken(['--params-file', str(file)])
        assert words in line and '\n' not in line and len(line) < 500, (content[:80], line)
        assert not line.startswith('parameter file') or str(file) in line
    for name, words in (('/nowhere/p.yaml', "'/nowhere/p.yaml' cannot be read: No such file"),
                        (str(tmp_path), f"'{tmp_path}' cannot be read: Is a directory"),
                        ('', "'' cannot be read: No such file"),
                        ('a\nb', "'a\\nb' cannot be read: No such file")):
        assert taken(['--params-file', name]).startswith(f'parameter file {words}')
    assert capfd.readouterr() == ('', '')


GOOD_FILES = {
    '': {}, '# nothing\n': {}, '\ufeff' + SECTION % 'window: 7': {'window': 7},
    # Of what is there twice the last counts, as everywhere in ROS; an integer is a double.
    SECTION % 'window: 7, window: 8': {'window': 8},
    f'{SECTION % "window: 7"}\n---\n{SECTION % "window: 9"}': {'window': 9},
    f'{SECTION % "window: 7"}\nsimulator: {{ros__parameters: {{alpha: x}}}}': {'window': 7},
    SECTION % 'publish_rate: 5': {'publish_rate': 5.0},
    # Octal and hexadecimal, as YAML 1.1 has them.
    SECTION % 'window: 010, publish_rate: 0x10': {'window': 8, 'publish_rate': 16.0}}


def test_parameter_files_that_are_taken(tmp_path: Path) -> None:
    """What is odd and right nevertheless."""
    file = tmp_path / 'p.yaml'
    for content, values in GOOD_FILES.items():
        file.write_text(content)
        begin(['--ros-args', '--params-file', str(file)])
        node = BaseNode('lyapunov')
        assert node.values == {'publish_rate': 10.0, 'window': 1000, **values}
        node.destroy_node()
        try_shutdown()


IGNORED = {
    SECTION % 'publish_rate: {a: 1.0}': "'publish_rate.a' is ignored; did you mean 'publish_rate'",
    SECTION % f'{"x" * 900}: 1': f"'{'x' * 76}... is ignored; known are publish_rate, window",
    SECTION % ('{a: ' * 200 + '1' + '}' * 200)[1:-1]: "'a.a.a.a",
    SECTION % 'publish_rat: 1.0': "'publish_rat' is ignored; did you mean 'publish_rate'?",
    '/**: {ros__parameters: {windo: 1}}': "'windo' is ignored; did you mean 'window'?",
    # Parameters of other nodes.
    '/**: {ros__parameters: {alpha: 1.0, use_sim_time: false}}': ''}


@pytest.mark.parametrize('content', IGNORED)
def test_names_that_a_node_does_not_declare_are_ignored(content: str, tmp_path: Path, capfd
                                                        ) -> None:
    """As ROS does, with a warning where no node declares them."""
    file = tmp_path / 'p.yaml'
    file.write_text(content)
    begin(['--ros-args', '--params-file', str(file)])
    node = BaseNode('lyapunov')
    assert node.values == {'publish_rate': 10.0, 'window': 1000}
    assert not node.has_parameter('alpha') and not node.has_parameter('windo')
    node.destroy_node()
    try_shutdown()
    line = capfd.readouterr().err
    words = IGNORED[content]
    assert words in line and line.count('\n') == bool(words)


@pytest.mark.parametrize('ros, words', [
    (['-p', 'window'], "-p 'window' is not understood; parameters are given as -p NAME:=VALUE"),
    (['-p', 'window:={a: 1}'], "-p 'window:={a: 1}' is not understood; "),
    (['-p', 'window:=[1, "a"]'], 'VALUE in YAML and of one type'),
    (['-p', 'window:='], "-p 'window:=' is not understood"),
    (['-p', 'window:=[]'], "'window' has no value"),
    (['-p', 'window:=\n'], "'window' has no value"),
    (['-p', 'window:=a\nb'], "window = 'a b' is not of type integer"),
    (['-p', 'a b:=1'], "-p 'a b:=1' is not understood"),
    (['-p', f'window:={2**63}'], 'window = 9.223372036854776e+18 is not of type integer'),
    (['-p', f'window:={"[" * 10_000}'], f"-p 'window:={'[' * 68}... is not understood"),
    (['-r', '__ns:=x'], "-r '__ns:=x' is not understood; names are changed by -r FROM:=TO"),
    (['--log-level', 'loud'], "--log-level 'loud' is not understood; levels are debug, info"),
    (['-p'], "Couldn't parse trailing -p flag."),
    (['-e', 'x'], "Enclave name is not valid: 'context name must be absolute")])
def test_overrides_that_are_none(ros: list[str], words: str, capfd) -> None:
    """One line that names the value, with the form where it is that which is wrong."""
    line = taken(ros)
    assert words in line and '\n' not in line and len(line) < 300
    # rcl refuses a very long argument for its length.
    assert '/src/' not in line and ('[[' in line or capfd.readouterr() == ('', ''))


def test_a_large_parameter_file_is_refused_unread(tmp_path: Path) -> None:
    """A mapping in a mapping, 1e5 times, takes rcl minutes; a pipe has no size to be judged by."""
    file = tmp_path / 'p.yaml'
    file.write_text('{a: ' * 100_000)
    with pytest.raises(ValueError, match=f"'{file}' has 400000 bytes; at most 100000 are"):
        refuse_large_files(['--params-file', str(file)])
    refuse_large_files(['--params-file', '/dev/null', '--params-file', '/nowhere'])


def test_a_pipe_is_read_once(start, tmp_path: Path) -> None:
    """As a shell gives it for <(...): its values are in force."""
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    node = start('lyapunov', '--ros-args', '--params-file', str(pipe))
    pipe.write_text('lyapunov: {ros__parameters: {window: -1}}')
    assert node.process.wait(60) == 2
    assert node.text().startswith('lyapunov: window = -1 is outside')


@pytest.mark.parametrize('arguments, words', [
    (['--rate', '5'], "unknown argument '--rate'; parameters are given as --ros-args -p"),
    (['--ros-args', '-q', 'foo'], "ROS refuses the arguments: ['-q', 'foo']"),
    (['--ros-args', '--params-file', '/nowhere'], "parameter file '/nowhere' cannot be read: No")])
def test_a_node_refuses_what_it_would_ignore(start, arguments: list[str], words: str) -> None:
    """One line, status 2."""
    node = start('lyapunov', *arguments)
    assert node.process.wait(60) == 2
    assert words in node.text() and len(node.text().strip().splitlines()) == 1


def test_a_misspelt_section_is_reported_and_the_node_goes_on(start, tmp_path: Path) -> None:
    """A warning only: the file may be meant for others too."""
    file = tmp_path / 'p.yaml'
    file.write_text('lyapunvo: {ros__parameters: {window: 5}}\n')
    node = start('lyapunov', '--ros-args', '--params-file', str(file))
    node.wait_for('ready')
    assert f"lyapunov: {file}: section 'lyapunvo' belongs to no node; did you mean" in node.text()
    assert node.stop() == 0


@pytest.mark.parametrize('name', ['simulator', 'recorder', 'teleop'])
def test_help_and_version_of_a_node(start, name: str) -> None:
    """The table of parameters, from which it declares them; status 0."""
    asked = start(name, '--help')
    assert asked.process.wait(60) == 0
    text = asked.text()
    for each in TABLES[name]:
        line, = (line for line in text.splitlines() if line.split()[:1] == [each.name])
        assert each.description in line and f'[{each.unit}]' in line or not each.unit
    asked = start(name, '--version')
    assert asked.process.wait(60) == 0
    assert asked.text() == f'{name} {version("gear_rattle_ros")}\n'


def test_the_suite_refuses_arguments_that_ros_does_not_take(start, tmp_path: Path) -> None:
    """In one line too, before a node is started."""
    suite = start('suite', '--output', str(tmp_path / 'run'), '--ros-args', '-p', 'alpha')
    assert suite.process.wait(60) == 2
    assert suite.text().startswith("suite: -p 'alpha' is not understood; parameters are given as")
    assert len(suite.text().strip().splitlines()) == 1
