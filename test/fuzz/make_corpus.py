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

"""Make the inputs that fuzzing starts from: PYTHONPATH=test python test/fuzz/make_corpus.py."""

import io
from pathlib import Path

import bag_maker
from mcap.writer import CompressionType, Writer

from gear_rattle_ros.bags import metadata
from gear_rattle_ros.bags.topics import Contents

CORPUS = Path(__file__).parent / 'corpus'
TOPIC = bag_maker.topic('/impacts', 'sensor_msgs/msg/PointCloud2')


def mcap(clouds: list[bytes], *, chunks: bool, crcs: bool, compression: CompressionType,
         finished: bool = True) -> bytes:
    """Return a file of clouds."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1000, compression=compression, use_chunking=chunks,
                    enable_crcs=crcs)
    writer.start('ros2', 'gear_rattle_ros')
    schema = writer.register_schema(TOPIC.type_name, 'ros2msg', b'')
    channel = writer.register_channel(TOPIC.name, 'cdr', schema, {'offered_qos_profiles': '[]'})
    for number, cloud in enumerate(clouds):
        writer.add_message(channel, bag_maker.STEP * number, cloud, bag_maker.STEP * number)
    if finished:
        writer.finish()
    return stream.getvalue()


def main() -> None:
    """Write them."""
    CORPUS.mkdir(exist_ok=True)
    clouds = bag_maker.batches(bag_maker.story(12), 4)
    inputs = {
        'plain': b'M' + mcap(clouds, chunks=False, crcs=False, compression=CompressionType.NONE),
        'chunks': b'M' + mcap(clouds, chunks=True, crcs=False, compression=CompressionType.NONE),
        'cut': b'M' + mcap(clouds, chunks=True, crcs=True, compression=CompressionType.NONE,
                           finished=False),
        'zstd': b'M' + mcap(clouds, chunks=True, crcs=True, compression=CompressionType.ZSTD),
        'lz4': b'M' + mcap(clouds, chunks=True, crcs=True, compression=CompressionType.LZ4),
        'cloud': b'C' + clouds[0],
        'no_points': b'C' + bag_maker.batches(bag_maker.story(2)[:1], 1)[0],
        'metadata': b'Y' + metadata.dump({'rosbag2_bagfile_information': metadata.document(
            {'bag.mcap': Contents({TOPIC.name: TOPIC}, {TOPIC.name: 3}, 1, 2)})}).encode(),
    }
    for name, data in inputs.items():
        (CORPUS / name).write_bytes(data)


if __name__ == '__main__':
    main()
