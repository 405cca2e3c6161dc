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

"""The basin node as a process: pictures, attractors and shares for a stream of parameters."""

from collections.abc import Callable
import dataclasses
import os
from pathlib import Path
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from gear_rattle_ros.attractors.finding import CONSERVES
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.watching import glance, watch
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import EventArray, Parameters, State, Wall
from gear_rattle_ros.messages import cloud_from_events, stamp_from_nanoseconds
from gear_rattle_ros.nodes.basin import Basin, Job, Memory, picture_of, Settings, Wanted
from gear_rattle_ros.nodes.viewer.basin import BasinInput
from gear_rattle_ros.palette import ENDS, LAYERS
from gear_rattle_ros.qos import LATCHED, STREAM

# The colour of an initial condition that has not settled.
PALE = int(ENDS[UNSETTLED][1:], 16)
STAMP = stamp_from_nanoseconds(7)


# Where the processor is busy, the defaults of the node let others go first for minutes.
PROMPT = ('-p', 'niceness:=1')
LONG = 240.0


class Pictures:
    """What the node publishes, in step: state, attractors and image of each picture."""

    def __init__(self, node: Node) -> None:
        self.states: list[DiagnosticArray] = []
        self.clouds: list[PointCloud2] = []
        self.images: list[Image] = []
        node.create_subscription(DiagnosticArray, 'basin_state', self.states.append, LATCHED)
        node.create_subscription(PointCloud2, 'attractors', self.clouds.append, LATCHED)
        node.create_subscription(Image, 'basin', self.images.append, LATCHED)

    def alpha(self) -> float:
        """Return the alpha of the newest picture."""
        return float(values_of(self.states[-1])['alpha']) if self.states else 0.0

    def has(self, alpha: float, size: int) -> bool:
        """Whether the newest of everything is a picture at this alpha and size."""
        return (self.alpha() == alpha and values_of(self.states[-1])['size'] == str(size)
                and bool(self.images) and bool(self.clouds) and self.images[-1].width == size
                and self.images[-1].header == self.clouds[-1].header
                and self.images[-1].header.stamp == self.states[-1].header.stamp)

    def has_whole(self, alpha: float, size: int) -> bool:
        """Whether everything has settled in it; a slow machine shows it before, too."""
        if not self.has(alpha, size):
            return False
        # All pictures at one alpha bear the same stamp.
        shares = dict(points_of(self.clouds[-1])[['label', 'share']].tolist())
        return (float(values_of(self.states[-1])['unsettled']) == 0.0
                and not np.any(pixels_of(self.images[-1]) == PALE)
                and sum(shares.values()) == pytest.approx(1.0))


def values_of(message: DiagnosticArray, number: int = 0) -> dict[str, str]:
    """Return the keys and values of a status."""
    return {item.key: item.value for item in message.status[number].values}


def attractors_of(message: DiagnosticArray) -> dict[int, dict[str, str]]:
    """Return what is reported of each attractor, by its impacts."""
    every = [values_of(message, number) for number in range(1, len(message.status))]
    return {int(each['impacts']): each for each in every}


def layers_of(message: MarkerArray) -> dict[str, list[tuple[float, float]]]:
    """Return the points of every layer that is shown."""
    return {each.ns: [(point.x, point.y) for point in each.points] for each in message.markers
            if each.action == Marker.ADD}


def pixels_of(image: Image) -> np.ndarray:
    """Return the colours of an image as numbers."""
    assert image.encoding == 'rgb8' and image.step == 3 * image.width
    parts = np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.width, 3)
    return parts.astype(np.int64) @ [65536, 256, 1]


def points_of(cloud: PointCloud2) -> np.ndarray:
    """Return the records of the cloud, read by its own fields."""
    kinds = {5: '<i4', 7: '<f4'}
    dtype = np.dtype({
        'names': [field.name for field in cloud.fields],
        'formats': [kinds[field.datatype] for field in cloud.fields],
        'offsets': [field.offset for field in cloud.fields], 'itemsize': cloud.point_step})
    return np.frombuffer(bytes(cloud.data), dtype)


def ramp(alphas: list[float]) -> list[EventArray]:
    """Return a batch for every alpha, the first from a reset."""
    simulation = Simulation(Parameters(alphas[0]), State(0, 0.0, 0.0, -0.5))
    batches = [simulation.advance(5, 0.0, 100)]
    for number, alpha in enumerate(alphas[1:], 2):
        retuned = simulation.retune(Parameters(alpha))
        batches.append(np.concatenate([retuned, simulation.advance(5 * number, 0.0, 100)]))
    return batches


def test_pictures_follow_the_parameters(start: Callable, rclpy_node: Node, spin: Callable) -> None:
    """Two attractors at 0.48, drawn twice as fine; they keep their colours at 0.49."""
    clouds = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    pictures = Pictures(rclpy_node)
    basin = start('basin', '--ros-args', '-p', 'size:=100', '-p', 'velocity_limit:=2.0', *PROMPT)
    basin.wait_for('ready', LONG)
    # Sessions share the processor first, where Linux groups them.
    session = Path(f'/proc/{basin.process.pid}/autogroup')
    # Others than root may change it only now and then.
    assert os.geteuid() or not session.exists() or session.read_text().endswith('nice 1\n')
    spin(clouds.get_subscription_count)
    first, second = ramp([0.48, 0.49])
    clouds.publish(cloud_from_events(first, stamp_from_nanoseconds(7)))
    spin(lambda: pictures.has_whole(0.48, 100), LONG)

    assert {image.width for image in pictures.images} <= {50, 100}
    state, image, cloud = pictures.states[-1], pictures.images[-1], pictures.clouds[-1]
    assert image.header.stamp == stamp_from_nanoseconds(7) and image.header.frame_id == 'section'
    picture, attractors = values_of(state), attractors_of(state)
    assert (picture['velocity_low'], picture['velocity_high']) == ('-2.0', '2.0')
    assert picture['epoch'] == '0' and picture['plane'] == 'impact'
    assert attractors.keys() == {2, 3}
    pixels, points = pixels_of(image), points_of(cloud)
    for impacts, each in attractors.items():
        colour = int(each['colour'][1:], 16)
        assert float(each['share']) == pytest.approx(np.mean(pixels == colour))
        own = points[points['label'] == int(each['label'])]
        assert len(own) == impacts and (own['rgb'].view(np.uint32) == colour).all()
        assert (own['z'] == np.where(own['y'] > 0.0, 0.0, -1.0)).all()
        np.testing.assert_allclose(own['share'], float(each['share']), rtol=1e-6)
        # Each point of an attractor lies in its basin: the top row is the greatest velocity.
        rows = ((2.0 - own['y']) * 25.0).astype(int)
        columns = (own['x'] * (100.0 / (2.0 * np.pi))).astype(int)
        assert (pixels[rows, columns] == colour).all()
    # The paper's two attractors of alpha = 0.48: the orbit recorded there has these velocities.
    np.testing.assert_allclose(
        np.sort(points['y'][points['label'] == int(attractors[2]['label'])]),
        [-0.52781368, 0.85850764], atol=1e-6)

    clouds.publish(cloud_from_events(second, stamp_from_nanoseconds(8)))
    spin(lambda: pictures.has_whole(0.49, 100), LONG)
    later = attractors_of(pictures.states[-1])
    assert {key: each['colour'] for key, each in later.items()} == {
        key: each['colour'] for key, each in attractors.items()}
    assert values_of(pictures.states[-1])['epoch'] == '1'
    assert basin.stop(signal.SIGINT) == 0, basin.text()


def test_the_smallest_kick_is_of_the_present_attractor(
        start: Callable, rclpy_node: Node, spin: Callable) -> None:
    """The kick that is published is applied to the simulator, which then is on what it names."""
    clouds = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    found: list[DiagnosticArray] = []
    rclpy_node.create_subscription(DiagnosticArray, 'smallest_kick', found.append, LATCHED)
    skeletons: list[MarkerArray] = []
    rclpy_node.create_subscription(MarkerArray, 'skeleton', skeletons.append, LATCHED)
    basin = start('basin', '--ros-args', '-p', 'size:=100', *PROMPT)
    basin.wait_for('ready', LONG)
    spin(clouds.get_subscription_count)

    def publish_until(count: int, events: EventArray) -> None:
        # Again and again: the node may match the publisher later than that matches the node.
        def has_come() -> bool:
            clouds.publish(cloud_from_events(events[-5:], STAMP))
            return len(found) >= count

        spin(has_come, LONG)

    simulation = Simulation(Parameters(0.48), State(0, 0.0, 0.0, -0.5))
    publish_until(1, simulation.advance(300, 0.0, 2000))
    spin(lambda: skeletons and len(layers_of(skeletons[-1])) == len(LAYERS), LONG)
    assert {each.header.frame_id for each in skeletons[-1].markers} == {'section'}
    first = values_of(found[0])
    kick = {name: float(first[name]) for name in ('kick', 'phase', 'velocity_after')}
    assert (first['alpha'], first['epoch']) == ('0.48', '0')
    assert {first['letter'], first['target_letter']} == {'A', 'B'}
    begin, end = layers_of(skeletons[-1])['smallest_kick']
    assert end[1] - begin[1] == pytest.approx(-kick['kick'] / Parameters().restitution)
    assert float(first['resolution']) < 0.1 * abs(kick['kick'])
    event = simulation.advance(1000, 0.0, 1)
    while abs(event['velocity_after'][0] - kick['velocity_after']) > 1e-6:
        event = simulation.advance(1000, 0.0, 1)
    assert event['phase'][0] == pytest.approx(kick['phase'], abs=1e-6)
    assert Wall(-int(event['displacement'][0])).label == first['wall']
    kicked = simulation.reset(event['phase'][0], event['displacement'][0],
                              event['velocity_after'][0] + kick['kick'])
    publish_until(2, np.concatenate([event, kicked, simulation.advance(1000, 0.0, 2000)]))
    second = values_of(found[-1])
    assert (second['epoch'], second['letter']) == ('1', first['target_letter'])
    # What is shown belongs to that attractor, and goes when the parameters change.
    spin(lambda: layers_of(skeletons[-1])['smallest_kick'] != [begin, end], LONG)
    clouds.publish(cloud_from_events(ramp([0.48, 0.49])[1], STAMP))
    spin(lambda: not layers_of(skeletons[-1]), LONG)
    # The impacts of the attractor that it was led to.
    assert len(set(np.round(simulation.advance(1500, 0.0, 60)['velocity'][-12:], 4))) == {
        'A': 3, 'B': 2}[second['letter']]
    assert basin.stop(signal.SIGINT) == 0, basin.text()


@pytest.mark.long
def test_work_is_dropped_when_parameters_move(start: Callable, rclpy_node: Node, spin: Callable
                                              ) -> None:
    """Of a fast ramp only the last value is drawn fine; one who comes late is given it."""
    clouds = rclpy_node.create_publisher(PointCloud2, 'impacts', STREAM)
    pictures = Pictures(rclpy_node)
    basin = start('basin', '--ros-args', '-p', 'size:=100', '-p', 'plane:=displacement', '-p',
                  'displacement:=-0.5')
    basin.wait_for('ready', 120.0)
    spin(clouds.get_subscription_count)
    alphas = [round(0.47 + 0.001 * number, 3) for number in range(30)]
    for number, batch in enumerate(ramp(alphas)):
        clouds.publish(cloud_from_events(batch, stamp_from_nanoseconds(number)))
        until = time.monotonic() + 0.02
        spin(lambda until=until: time.monotonic() > until)
    spin(lambda: pictures.has(alphas[-1], 100), 60.0)
    fine = [values_of(state) for state in pictures.states if values_of(state)['size'] == '100']
    assert len({each['alpha'] for each in fine}) < len(alphas) / 2
    assert fine[-1]['displacement'] == '-0.5' and fine[-1]['plane'] == 'displacement'
    late = Pictures(rclpy_node)
    spin(lambda: late.has(alphas[-1], 100), 20.0)
    assert basin.stop(signal.SIGTERM) == 0, basin.text()


def test_a_bad_plane_is_one_line(start: Callable) -> None:
    """Exit status 2, and one line that names the value."""
    basin = start('basin', '--ros-args', '-p', 'plane:=floor')
    assert basin.process.wait(60) == 2
    assert basin.text() == (
        "basin: plane = 'floor' is not one of section, impact, displacement, strobe\n")


@pytest.mark.parametrize(('plane', 'shown'), [
    (Plane(phase=1.5, kind='strobe'), {
        'plane': 'strobe', 'phase': '1.5', 'displacement_low': '-1.0',
        'displacement_high': '0.0'}),
    (Plane(kind='section'), {'plane': 'section', 'phase_low': '0.0'})])
def test_a_picture_of_another_plane_stays_out_of_the_section(
        plane: Plane, shown: dict[str, str]) -> None:
    """The viewer draws basins below impacts only where they have their axes."""
    parameters = Parameters(0.1, 0.0, 0.0, 1.0)
    settings = Settings((50,), plane, 1.0, 100, 1, 0)
    basins, = watch(glance(parameters, np.zeros((0, 3)))[0], [
        dataclasses.replace(plane, phases=50, velocities=50)], cap=100, threads=1,
        is_dropped=lambda: False)
    picture = picture_of(Wanted(parameters, 1, STAMP, 0.0, False), basins, (), Memory(), settings)
    values = values_of(picture.state)
    assert {name: values[name] for name in shown} == shown
    inputs = BasinInput()
    assert [inputs.take(name, part) for name, part in (
        ('basin', picture.image), ('attractors', picture.attractors),
        ('basin_state', picture.state))] == [None] * 3


def test_where_areas_are_preserved_all_is_unsettled_and_explained() -> None:
    """Without a search, and without following anything."""
    parameters = Parameters(0.1, 0.0, 0.0, 1.0)
    planes = [Plane(velocity=(-1.0, 1.0), phases=size, velocities=size, kind='impact')
              for size in (50, 400)]
    settings = Settings((50, 400), planes[0], 1.0, 10_000_000, 1, 0)
    shown = list(watch(glance(parameters, np.zeros((0, 3)))[0], planes, cap=settings.cap,
                       threads=1, is_dropped=lambda: False))
    assert [basins.plane for basins in shown] == planes
    for basins in shown:
        picture = picture_of(
            Wanted(parameters, 1, STAMP, 0.0, False), basins, (), Memory(), settings)
        assert picture.state.status[0].message.endswith(
            f'0 attractors, 100.0% unsettled: {CONSERVES}')
        assert [values_of(picture.state, 1)[name] for name in ('key', 'share')] == [
            'unsettled', '1.0']


@pytest.mark.filterwarnings('error::pytest.PytestUnhandledThreadExceptionWarning')
def test_a_job_that_ends_after_its_node_wakes_nobody(rclpy_node: Node) -> None:
    """Its thread lives on for a moment, and must not trigger what is destroyed."""
    node = Basin(context=rclpy_node.context)
    wanted = Wanted(Parameters(), 0, STAMP, 0.0, False)
    job = Job(wanted, Memory(), node._settings, True, node._put)
    node.close()
    node.destroy_node()
    job.dropped.set()
    job.start()
    job.join(60)
    assert not job.is_alive() and not job.failure
    assert node._results.qsize() == 1
