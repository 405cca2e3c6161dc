"""Counts and tables in words."""

import pytest

from gear_rattle_ros.core.words import counted, in_columns


@pytest.mark.parametrize(('count', 'noun', 'words'), [
    (0, 'impact', '0 impacts'), (1, 'drive period', '1 drive period'),
    (2, 'trajectory', '2 trajectories'), (1, 'trajectory', '1 trajectory'),
    (3, 'batch', '3 batches'), (12345.0, 'start', '12,345 starts')])
def test_one_is_singular(count, noun, words):
    assert counted(count, noun) == words


def test_columns_are_aligned_below_their_headings():
    text = in_columns([' label', 'key', ' share [%]'], [['0', 'a', '65.00'], ['-1', 'bcd', '3.1']])
    assert text.split('\n') == ['label  key  share [%]',
                                '    0  a        65.00',
                                '   -1  bcd        3.1']
    assert in_columns(['a', 'b'], []) == 'a  b'
