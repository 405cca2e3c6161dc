"""The keyboard control: its keys, its terminal, its node."""
