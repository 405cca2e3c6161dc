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

"""Stores as xarray alone reads them, and what becomes of them in NetCDF."""

import warnings

import numpy as np
import pytest
import xarray

from gear_rattle_ros.cli import attractors
from gear_rattle_ros.cli.grids import basins, exponents, lifetimes
from gear_rattle_ros.cli.robustness import stability
from gear_rattle_ros.cli.skeleton import boundary
from gear_rattle_ros.cli.sweeps import orbit_diagram
from gear_rattle_ros.cli.trajectories import motion, rattle, section
from gear_rattle_ros.cli.transitions import continuation, crisis, transitions
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.store.store import open_dataset

SMALL = {
    attractors: '--starts 20 --hold 1000',  # the old name of --initial-conditions
    basins: '--size 6 --initial-conditions 20 --tile 3 --hold 1000',
    boundary: '--size 30 --distances 1e-4 1e-1 --per-decade 1 --error 0.3 --initial-conditions 20 '
              '--hold 1000',
    continuation: '--alpha 0.5 0.51 --columns 2 --trajectories 4 --hold 500 --skip 300 '
                  '--keep 256 --tolerance 1e-3',
    crisis: '--rates 4 --escapes 40 --beyond 1e-3 1e-2 --limit 100000',
    exponents: '--size 6',
    lifetimes: '--size 6 --initial-conditions 20 --tile 3 --hold 1000 --cap 2000',
    motion: '--periods 2 --initial-conditions 20 --hold 1000',
    orbit_diagram: '--alpha 0.48 0.5 --columns 3 --bins 20 --trajectories 3 --skip 100 '
                   '--keep 256',
    rattle: f'--gears {config_folder("gears")}/example.yaml --run-up 400 500 --points 2 --periods '
            '5 --initial-conditions 5 --hold 1000',
    section: '--alpha 0.48 --trajectories 3 --keep 300 --skip 10 --bins 9 8',
    stability: '--size 6 --initial-conditions 20 --hold 1000 --cap 1000 --to 0.5',
    transitions: '--alpha 0.10 0.101 --columns 2 --trajectories 4 --hold 500 --keep 256'}


def assert_same(found, expected, as_kept=None):
    """Hold the numbers and words of a dataset, and their types, against those of another."""
    assert set(found.variables) == set(expected.variables)
    for name, variable in expected.variables.items():
        values, dtype = found[name].values, variable.dtype
        # The oldest NetCDF has no integers without a sign, and words as objects.
        kinds = as_kept[dtype.kind] if as_kept else dtype.kind
        assert values.dtype.kind in kinds, (name, values.dtype, dtype)
        assert as_kept or values.dtype == dtype, (name, values.dtype, dtype)
        assert np.array_equal(values.astype(dtype), variable.values,
                              equal_nan=dtype.kind == 'f'), name


@pytest.mark.parametrize('tool', [
    pytest.param(tool, marks=pytest.mark.long if tool in (boundary, crisis) else ())
    for tool in SMALL])
def test_what_a_tool_writes_is_what_xarray_reads(tool, tmp_path):
    """Neither 0 nor -1 is missing, nothing is warned of, and the oldest NetCDF holds it."""
    path, copy = tmp_path / 'a.zarr', tmp_path / 'a.nc'
    assert tool.main([*SMALL[tool].split(), '--output', str(path)]) == 0
    expected = open_dataset(path)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        plain = xarray.open_zarr(path, chunks=None)
    assert_same(plain.drop_vars('tile_done'), expected)
    for dataset in (expected, plain):
        dataset.to_netcdf(copy, engine='scipy')
        with xarray.open_dataset(copy, engine='scipy') as back:
            assert_same(back, dataset, {'i': 'i', 'u': 'i', 'f': 'f', 'T': 'OU'})
            assert set(back.attrs) == set(dataset.attrs)
            for name, value in dataset.attrs.items():
                assert np.array_equal(back.attrs[name], value), name
