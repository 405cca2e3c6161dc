"""The metadata.yaml of a bag, version 9, with the keys and their order of rosbag2 in Jazzy."""

from collections.abc import Sequence
import dataclasses
import json
import os
from pathlib import Path
from typing import Any, Final

import yaml

from .topics import BagError, Topic
from ..plain_yaml import read_yaml

VERSION: Final = 9
NAME: Final = 'metadata.yaml'
DISTRIBUTION: Final = 'jazzy'
# What rosbag2 writes for the start of a bag without messages.
_NEVER: Final = 2**63 - 1


@dataclasses.dataclass(frozen=True)
class Part:
    """A file of a bag: its messages by topic, and the log time of its first and last."""

    name: str
    counts: tuple[tuple[Topic, int], ...]
    start: int
    end: int

    @property
    def total(self) -> int:
        """Count the messages of all topics."""
        return sum(count for _, count in self.counts)


def document(parts: Sequence[Part]) -> dict[str, Any]:
    """Return what stands under ``rosbag2_bagfile_information`` for a bag of these files."""
    counts: dict[str, tuple[Topic, int]] = {}
    for part in parts:
        for topic, count in part.counts:
            counts[topic.name] = (topic, counts.get(topic.name, (topic, 0))[1] + count)
    filled = [part for part in parts if part.total]
    start = min((part.start for part in filled), default=_NEVER)
    end = max((part.end for part in filled), default=_NEVER)
    return {
        'version': VERSION,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': end - start},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': sum(part.total for part in parts),
        'topics_with_message_count': [{
            'topic_metadata': {
                'name': topic.name,
                'type': topic.type_name,
                'serialization_format': 'cdr',
                'offered_qos_profiles': [dict(qos) for qos in topic.offered_qos],
                'type_description_hash': topic.type_hash,
            },
            'message_count': count,
        } for topic, count in counts.values()],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [part.name for part in parts],
        'files': [{
            'path': part.name,
            'starting_time': {'nanoseconds_since_epoch': part.start if part.total else _NEVER},
            'duration': {'nanoseconds': part.end - part.start if part.total else 0},
            'message_count': part.total,
        } for part in parts],
        'custom_data': None,
        'ros_distro': DISTRIBUTION,
    }


def dump(content: object) -> str:
    """Write YAML in block style."""
    # The way through JSON leaves nothing shared, which YAML would write as an alias.
    separate = json.loads(json.dumps(content))
    return str(yaml.safe_dump(separate, sort_keys=False, default_flow_style=False))


def write(directory: Path, information: dict[str, Any]) -> None:
    """Replace the metadata.yaml of a bag, so that a reader sees the old one or the new one."""
    text = dump({'rosbag2_bagfile_information': information})
    new = directory / f'.{NAME}.new'
    with new.open('w', encoding='utf-8') as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    new.replace(directory / NAME)


def file_names(directory: Path) -> list[str]:
    """Return the files of a bag in order; where metadata.yaml is missing, all .mcap files."""
    path = directory / NAME
    try:
        content = read_yaml(path.read_text('utf-8'))
        information = content['rosbag2_bagfile_information']
        storage = information['storage_identifier']
        if storage != 'mcap':
            # A few lines of YAML can make a value that fills the memory when it is printed.
            named = repr(storage) if isinstance(storage, str) else type(storage).__name__
            raise BagError(f'{path}: storage is {named[:80]}, not mcap')
        names = list(information['relative_file_paths'])
        if not all(isinstance(name, str) and name == Path(name).name for name in names):
            raise BagError(f'{path}: relative_file_paths are not all names of files beside it')
        return names
    except FileNotFoundError:
        return sorted(
            (entry.name for entry in directory.glob('*.mcap')), key=lambda name: (len(name), name))
    except BagError:
        raise
    except (ValueError, LookupError, TypeError):
        raise BagError(f'{path}: is not the metadata of a bag') from None
