"""The replay: a node, and the thread that sends a bag."""
