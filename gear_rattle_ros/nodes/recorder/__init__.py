"""The recorder: a node, and the thread that writes its bag."""
