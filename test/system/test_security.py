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

"""Keeping others out: the policies are exactly what the nodes use, and nothing listens abroad."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import time
from xml.etree import ElementTree

from bag_maker import batches, story, topic
import pytest
import rclpy
from rclpy.node import Node

from gear_rattle_ros.bags import BagWriter
from gear_rattle_ros.explorer.simulator_link import SimulatorLink
from gear_rattle_ros.nodes.suite.display import Status
from gear_rattle_ros.nodes.suite.node import enclave, Monitor, secured
from gear_rattle_ros.nodes.teleop.node import Teleop
from gear_rattle_ros.parameters import TABLES

POLICY = Path(__file__).parents[2] / 'config' / 'sros2' / 'gear_rattle_ros.policy.xml'
RULES = {('topics', 'publish'): 'publisher', ('topics', 'subscribe'): 'subscriber',
         ('services', 'reply'): 'service', ('services', 'request'): 'client'}
Graph = set[tuple[str, str]]


def policies() -> dict[str, Graph]:
    """Return what the file allows each node."""
    allowed: dict[str, Graph] = {}
    for profile in ElementTree.parse(POLICY).iter('profile'):
        graph = allowed.setdefault(profile.attrib['node'], set())
        for group in profile:
            (qualifier, value), = group.attrib.items()
            assert value == 'ALLOW'
            graph |= {(RULES[group.tag, qualifier], rule.text or '') for rule in group}
    return allowed


def graph_of(looker: Node, name: str) -> Graph:
    """Return what a node uses."""
    found: Graph = set()
    for kind in RULES.values():
        ask = getattr(looker, f'get_{kind}_names_and_types_by_node')
        found |= {(kind, used) for used, _ in ask(name, '/')}
    return found


def test_the_policy_has_the_published_structure() -> None:
    """As the schema of policy 0.2.0 wants it: elements, attributes, and their order."""
    root = ElementTree.parse(POLICY).getroot()
    assert (root.tag, root.attrib) == ('policy', {'version': '0.2.0'})
    enclaves, = root
    assert enclaves.tag == 'enclaves'
    paths = []
    for one in enclaves:
        assert one.tag == 'enclave' and set(one.attrib) == {'path'}
        paths.append(one.attrib['path'])
        profiles, = one
        profile, = profiles
        assert (profiles.tag, profile.tag) == ('profiles', 'profile')
        assert profile.attrib == {'ns': '/', 'node': one.attrib['path'].split('/')[-1]}
        for group in profile:
            assert (group.tag, *group.attrib) in RULES and len(group)
            names = [rule.text or '' for rule in group]
            assert {rule.tag for rule in group} == {group.tag[:-1]}
            assert all(re.fullmatch(r'(/[a-z_]+)+', name) for name in names)
            assert names == sorted(set(names))
    assert len(set(paths)) == len(paths)
    # No node with parameters is forgotten.
    assert {enclave(name) for name in ('suite', 'explorer', 'steering', *TABLES)} <= set(paths)


@pytest.fixture
def context(domain: int) -> Iterator[None]:
    """Start rclpy as the nodes do it."""
    rclpy.init(domain_id=domain)
    yield
    rclpy.try_shutdown()


def children(process: int) -> list[int]:
    """Return a process and everything that it has started."""
    found = [process]
    for child in Path(f'/proc/{process}/task/{process}/children').read_text().split():
        found += children(int(child))
    return found


def sockets(process: int) -> set[str]:
    """Return the inodes of a process's sockets."""
    found = set()
    for entry in Path(f'/proc/{process}/fd').iterdir():
        try:
            target = os.readlink(entry)
        except OSError:
            continue
        if target.startswith('socket:['):
            found.add(target[8:-1])
    return found


def bag_of_everything(path: Path) -> None:
    """Write a bag with every topic that a replay publishes."""
    writer = BagWriter(path, 'none')
    for name, kind in (
        ('impacts', 'sensor_msgs/msg/PointCloud2'), ('joint_states', 'sensor_msgs/msg/JointState'),
        ('lyapunov', 'sensor_msgs/msg/JointState'), ('basin', 'sensor_msgs/msg/Image'),
        ('transient', 'diagnostic_msgs/msg/DiagnosticArray'),
        ('last_impact', 'sensor_msgs/msg/JointState'), ('rattle', 'sensor_msgs/msg/JointState'),
        ('hops', 'sensor_msgs/msg/JointState'), ('control', 'sensor_msgs/msg/JointState'),
        ('attractors', 'sensor_msgs/msg/PointCloud2'),
        ('basin_state', 'diagnostic_msgs/msg/DiagnosticArray'),
        ('smallest_kick', 'diagnostic_msgs/msg/DiagnosticArray'),
        ('skeleton', 'visualization_msgs/msg/MarkerArray'),
    ):
        channel = writer.add_topic(topic(f'/{name}', kind))
        if name == 'impacts':
            for number, cloud in enumerate(batches(story(1000))):
                writer.write(channel, number * 10**9, number * 10**9, number, cloud)
    writer.close()


@pytest.mark.long
def test_the_policies_are_the_real_graph_and_nothing_listens_abroad(
        start, domain: int, context: None, tmp_path: Path) -> None:
    """Real nodes: each uses exactly what its policy allows; TCP is on loopback, no multicast."""
    bag_of_everything(tmp_path / 'old')
    given = {
        'simulator': ['-p', 'publish_clock:=true'], 'lyapunov': [], 'transients': [],
        'recorder': ['-p', f'output:={tmp_path}/bag'],
        'viewer': ['-p', 'mode:=none', '-p', f'save:={tmp_path}/run.rrd'],
        'basin': ['-p', 'size:=100'], 'control': [],
        'replay': ['-p', f'bag:={tmp_path}/old', '-p', 'clock:=true', '-p', 'loop:=true'],
    }
    running = {name: start(name, '--ros-args', *more) for name, more in given.items()}
    here = [Monitor(Status()), Teleop()]
    link = SimulatorLink()
    link.join()
    allowed = policies()
    wanted = {name: allowed[name] for name in (*given, 'suite', 'teleop', 'explorer')}
    found: dict[str, Graph] = {}
    # The basin node may have to compile first.
    deadline = time.monotonic() + 240.0
    while found != wanted and time.monotonic() < deadline:
        rclpy.spin_once(here[0], timeout_sec=0.1)
        seen = {name for name, _ in here[0].get_node_names_and_namespaces()}
        found = {name: graph_of(here[0], name) for name in wanted if name in seen}
        assert all(node.process.poll() is None for node in running.values())
    assert found == wanted
    link.close()
    for node in here:
        node.destroy_node()
    multicast = 7400 + 250 * domain
    for name, node in running.items():
        for process in children(node.process.pid):
            own = sockets(process)
            for protocol in ('tcp', 'tcp6', 'udp', 'udp6'):
                table = Path(f'/proc/net/{protocol}').read_text().splitlines()[1:]
                for line in table:
                    words = line.split()
                    address, port = words[1].rsplit(':', 1)
                    if words[9] not in own:
                        continue
                    if protocol.startswith('tcp') and words[3] == '0A':
                        assert address == '0100007F', f'{name} listens on {words[1]}'
                    assert int(port, 16) != multicast, f'{name} listens to multicast'
    for name, node in running.items():
        assert node.stop(within=30.0) == 0, name
    written = [path for path in tmp_path.rglob('*') if path.is_file()]
    assert tmp_path / 'bag' / 'metadata.yaml' in written and tmp_path / 'run.rrd' in written
    for path in written:
        # Neither written to by everybody nor executed by anybody.
        assert not path.stat().st_mode & 0o113, path


def test_the_suite_gives_each_node_its_enclave(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where security is on, unless its user names one for all."""
    monkeypatch.delenv('ROS_SECURITY_ENABLE', raising=False)
    assert secured('viewer', []) == []
    monkeypatch.setenv('ROS_SECURITY_ENABLE', 'true')
    assert secured('viewer', []) == ['--ros-args', '--enclave', '/gear_rattle_ros/viewer']
    given = ['--ros-args', '--enclave', '/mine']
    assert secured('viewer', given) == given
