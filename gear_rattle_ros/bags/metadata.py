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

"""The metadata.yaml of a bag, version 9, with the keys and their order of rosbag2 in Jazzy."""

from collections.abc import Mapping
import json
import os
from pathlib import Path
from typing import Any, Final

import yaml

from .topics import BagError, Contents, Topic
from ..plain_yaml import read_yaml

NAME: Final = 'metadata.yaml'


def document(files: Mapping[str, Contents]) -> dict[str, Any]:
    """Return what stands under ``rosbag2_bagfile_information`` for a bag of these files."""
    topics: dict[str, Topic] = {}
    counts: dict[str, int] = {}
    for contents in files.values():
        topics |= contents.topics
        for name, count in contents.counts.items():
            counts[name] = counts.get(name, 0) + count
    start = min(contents.start for contents in files.values())
    end = max((contents.end for contents in files.values() if contents.total), default=start)
    return {
        'version': 9, 'storage_identifier': 'mcap',
        'duration': {'nanoseconds': end - start},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': sum(counts.values()),
        'topics_with_message_count': [{
            'topic_metadata': {
                'name': topic.name, 'type': topic.type_name,
                'serialization_format': topic.serialization,
                'offered_qos_profiles': [dict(qos) for qos in topic.offered_qos],
                'type_description_hash': topic.type_hash,
            },
            'message_count': counts[topic.name],
        } for topic in topics.values()],
        'compression_format': '', 'compression_mode': '',
        'relative_file_paths': list(files),
        'files': [{
            'path': name,
            'starting_time': {'nanoseconds_since_epoch': contents.start},
            'duration': {'nanoseconds': max(contents.end - contents.start, 0)},
            'message_count': contents.total,
        } for name, contents in files.items()],
        'custom_data': None, 'ros_distro': 'jazzy',
    }


def dump(content: object) -> str:
    # The way through JSON leaves nothing shared, which YAML would write as an alias.
    return str(yaml.safe_dump(json.loads(json.dumps(content)), sort_keys=False))


def write(directory: Path, information: dict[str, Any]) -> None:
    """Replace the metadata.yaml of a bag, so that a reader sees the old one or the new one."""
    text = dump({'rosbag2_bagfile_information': information})
    new = directory / f'.{NAME}.new'
    with new.open('w', encoding='utf-8') as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    new.replace(directory / NAME)


def require_readable(path: Path, information: Mapping[str, Any]) -> None:
    """Raise BagError if rosbag2 compressed what was recorded otherwise than is read here."""
    form, mode = (str(information.get(f'compression_{key}') or '')[:80]
                  for key in ('format', 'mode'))
    if mode.upper() not in ('', 'NONE') and form != 'zstd':
        raise BagError(f'{path}: its compression_mode is {mode} with {form or "no format"}, and '
                       'only zstd is read; convert the bag with ros2 bag convert')


def read_information(directory: Path) -> dict[str, Any] | None:
    """Return what metadata.yaml holds; None if there is none, BagError if it is no metadata."""
    path = directory / NAME
    try:
        return dict(read_yaml(path.read_text('utf-8'))['rosbag2_bagfile_information'])
    except FileNotFoundError:
        return None
    except (ValueError, LookupError, TypeError):
        raise BagError(f'{path}: is not the metadata of a bag') from None


def file_names(directory: Path) -> list[str]:
    """Return the files of a bag in order; where metadata.yaml is missing, all .mcap files."""
    path = directory / NAME
    information = read_information(directory)
    if information is None:
        return glob(directory)
    storage = information.get('storage_identifier')
    if storage not in ('mcap', '', None):
        # A few lines of YAML can make a value that fills the memory when it is printed.
        named = repr(storage) if isinstance(storage, str) else type(storage).__name__
        raise BagError(f'{path}: storage is {named[:80]}, not mcap; convert it with '
                       'ros2 bag convert')
    names = information.get('relative_file_paths')
    if not isinstance(names, list) or not all(
            isinstance(name, str) and name == Path(name).name for name in names):
        raise BagError(f'{path}: relative_file_paths are not all names of files beside it')
    require_readable(path, information)
    return names


def glob(directory: Path) -> list[str]:
    """Return the .mcap files in a directory, and those compressed whole; each recording once."""
    names = {entry.name.removesuffix('.zstd'): entry.name
             for pattern in ('*.mcap.zstd', '*.mcap') for entry in directory.glob(pattern)}
    return sorted(names.values(), key=lambda name: (len(name), name))
