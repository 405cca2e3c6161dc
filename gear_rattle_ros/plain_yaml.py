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
