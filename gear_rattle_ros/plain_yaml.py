"""YAML that anybody may have written: read as plain data, never executed, refused by one error."""

from typing import Any

import yaml


def read_yaml(text: str) -> Any:
    """Return what it says; ValueError, in one line, where it is no YAML."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f'is no YAML: {" ".join(str(error).split())}') from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        # What yaml makes of a bad date, number or nesting is not always an error of its own.
        raise ValueError(f'is no YAML: {type(error).__name__}') from error
