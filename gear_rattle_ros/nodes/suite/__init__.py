"""The whole suite in one command: its processes and its display."""
