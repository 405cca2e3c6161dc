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

"""YAML from any source: read as plain data, never executed, refused with one error."""

from typing import Any

import yaml


def read_yaml(text: str) -> Any:
    """Return the data; ValueError, in one line, where the text is not YAML."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f'is not YAML: {" ".join(str(error).split())}') from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        # For a bad date, number or nesting yaml does not always raise an error of its own.
        raise ValueError(f'is not YAML: {type(error).__name__}') from error
