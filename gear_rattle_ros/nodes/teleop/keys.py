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

"""Keys of the keyboard control: from bytes of a terminal to names, and a line being typed."""

from collections.abc import Iterator
import re

# Bytes that terminals send for arrows, plain and with shift: xterm, its application mode, rxvt.
_ARROWS = {b'A': 'up', b'B': 'down', b'C': 'right', b'D': 'left'}
_SEQUENCES = {
    **{b'\x1b[' + letter: name for letter, name in _ARROWS.items()},
    **{b'\x1bO' + letter: name for letter, name in _ARROWS.items()},
    **{b'\x1b[1;2' + letter: f'shift-{name}' for letter, name in _ARROWS.items()},
    **{b'\x1b[' + letter.lower(): f'shift-{name}' for letter, name in _ARROWS.items()},
    b'\r': 'enter', b'\n': 'enter', b'\x7f': 'backspace', b'\x08': 'backspace', b' ': 'space',
}
# One key: a byte, or a whole sequence; nothing matches one that has only begun.
_KEY = re.compile(rb'[^\x1b]|\x1bO.|\x1b\[[^@-~]*[@-~]|\x1b(?=[^O\[])', re.DOTALL)


class Keys:
    """Turns bytes of a terminal into names of keys; a sequence may come in pieces."""

    def __init__(self) -> None:
        self._held = b''

    def take(self, data: bytes) -> Iterator[str]:
        """Yield the keys in some bytes; printable ASCII names itself, the rest is ignored."""
        data = self._held + data
        self._held = b''
        while data:
            found = _KEY.match(data)
            if found is None:
                self._held = data
                return
            word, data = found[0], data[found.end():]
            if word in _SEQUENCES:
                yield _SEQUENCES[word]
            elif len(word) == 1 and 0x21 <= word[0] <= 0x7e:
                yield word.decode()

    def rest(self) -> Iterator[str]:
        """Yield `escape` if that byte came last and nothing followed."""
        if self._held == b'\x1b':
            yield 'escape'
        self._held = b''

    @property
    def is_open(self) -> bool:
        return bool(self._held)


class Entry:
    """A line of names and values that is being typed."""

    def __init__(self, question: str) -> None:
        self.question = question
        self.text = ''

    def take(self, key: str) -> str | None:
        """Take a key; return the text at Enter, '' at Escape, None while it is open."""
        if key in ('enter', 'escape'):
            return self.text.strip() if key == 'enter' else ''
        if key == 'backspace':
            self.text = self.text[:-1]
        elif key == 'space':
            self.text += ' '
        elif len(key) == 1 and (key.isalnum() or key in '._+-<'):
            self.text += key
        return None
