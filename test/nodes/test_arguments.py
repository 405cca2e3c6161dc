"""What a node makes of its command line: nothing is passed over in silence."""

from pathlib import Path

import pytest

from gear_rattle_ros.nodes.arguments import misspelt_sections, refuse_plain, split_arguments


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
        f"{file}: section '/**/simulatr' is for no node; did you mean 'simulator'?"]
    assert not list(misspelt_sections('lyapunov', ros))
    for text in ('[1, 2', '- 1', '', '5: {}', '\x00'):
        file.write_text(text)
        assert not list(misspelt_sections('simulator', ros))
    assert not list(misspelt_sections('simulator', ['--params-file', '/nowhere']))


@pytest.mark.parametrize('arguments, words', [
    (['--rate', '5'], "argument '--rate' is not known; parameters are given as --ros-args -p"),
    (['--ros-args', '-q', 'foo'], "ROS does not know the arguments ['-q', 'foo']")])
def test_a_node_refuses_what_it_would_ignore(start, arguments: list[str], words: str) -> None:
    """One line, status 2."""
    node = start('lyapunov', *arguments)
    assert node.process.wait(60) == 2
    assert words in node.text() and len(node.text().strip().splitlines()) == 1


def test_a_misspelt_section_is_said_and_the_node_goes_on(start, tmp_path: Path) -> None:
    """A warning only: the file may be meant for others too."""
    file = tmp_path / 'p.yaml'
    file.write_text('lyapunvo: {ros__parameters: {window: 5}}\n')
    node = start('lyapunov', '--ros-args', '--params-file', str(file))
    node.wait_for('ready')
    assert f"lyapunov: {file}: section 'lyapunvo' is for no node; did you mean" in node.text()
    assert node.stop() == 0
