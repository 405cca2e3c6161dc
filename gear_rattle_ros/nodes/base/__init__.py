"""What nodes share: the node, its events, its process, the client of a simulator."""
