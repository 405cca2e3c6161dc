"""What nodes share: the node itself, its events, its process, the client of a simulator."""
