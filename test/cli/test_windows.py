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

"""How windows of an option become a path through the parameters."""

import pytest

from gear_rattle_ros import gear_pairs
from gear_rattle_ros.cli import options
from gear_rattle_ros.cli.refusal import Parser
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.places import config_folder

PAIR = config_folder('gears') / 'example.yaml'


@pytest.mark.parametrize(('words', 'said'), [
    ('--alpha 0.6 0.5', 'alpha window 0.6 to 0.5 is empty or reversed; give the lower end first'),
    ('--gamma 0.1 0.1', 'gamma window 0.1 to 0.1 is empty'),
    ('--alpha 0.5', 'no parameter has a window; give one two values, such as --beta 0.1 0.2'),
    ('--beta 0.1 0.2 --beta 0.3 0.4', 'give one window of --beta, not 2'),
    ('--beta 0.1 0.2 --gamma 0.1 0.2 --gamma 0.2 0.3', 'as many windows of --beta as of --gamma'),
    ('--restitution 0.5 1.5', r'restitution = 1.5 is outside \[0, 1\]')])
def test_windows_that_are_none_are_refused(words, said):
    with pytest.raises(ValueError, match=said):
        options.path_of(parse(words, ((0.47, 0.6),)))


def parse(words, windows=None):
    """Read the options of the model."""
    parser = Parser('tool')
    options.add_model(parser, windows=windows)
    return gear_pairs.parse(parser, words.split())


@pytest.mark.parametrize(('words', 'path'), [
    ('', Path.over(alpha=(0.47, 0.6))),
    ('--beta 0', Path.over(Parameters(beta=0.0), alpha=(0.47, 0.6))),
    ('--beta 0.05 0.2', Path.over(Parameters(0.48), beta=(0.05, 0.2))),
    ('--beta 0.05 0.2 --alpha 1', Path.over(Parameters(1.0), beta=(0.05, 0.2))),
    ('--beta 0.2 0.05 --alpha 1 2', Path(Parameters(1.0, 0.2), Parameters(2.0, 0.05)))])
def test_a_window_is_typed_where_a_value_is(words, path):
    assert options.path_of(parse(words, ((0.47, 0.6),))) == path


def test_a_window_of_a_gear_pair_keeps_its_alpha():
    path = options.path_of(parse(f'--gears {PAIR} --beta 0.05 0.2', ((0.47, 0.6),)))
    pair = gear_pairs.read_gears(PAIR).parameters
    assert path == Path.over(pair, beta=(0.05, 0.2)) and pair.alpha != Parameters().alpha


def test_windows_come_one_after_the_other():
    given = parse('--alpha 1 2 --alpha 3 4 --gamma 0.1 0.2 --gamma 0.3 0', ((0.1, 0.2),))
    assert options.paths_of(given) == (
        Path(Parameters(1.0, gamma=0.1), Parameters(2.0, gamma=0.2)),
        Path(Parameters(3.0, gamma=0.3), Parameters(4.0, gamma=0.0)))


def test_several_values_are_taken_in_turn():
    given = parse('--alpha 0.4 0.45 --gamma 0.1 0.2 --beta 0')
    assert [(options.model_of(one), mark) for one, mark in options.one_by_one(given)] == [
        (Parameters(alpha, 0.0, gamma), f'-alpha-{alpha:g}-gamma-{gamma:g}')
        for alpha in (0.4, 0.45) for gamma in (0.1, 0.2)]
    assert [mark for _, mark in options.one_by_one(parse('--alpha 0.4'))] == ['']
