"""Named quality-of-service profiles."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

# Batches that a publisher keeps for readers that have not acknowledged them.
STREAM_DEPTH = 1000


def profile(depth: int, *, is_reliable: bool = True, is_latched: bool = False) -> QoSProfile:
    """Return a profile that keeps the last `depth` messages, or all of them where that is 0."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE)


# Everything that must not be lost.
STREAM = profile(STREAM_DEPTH)
# How the nodes of the package read it: a full reader refuses and so holds the writer up, where
# one that keeps the last would drop the oldest batch in silence.
STREAM_INPUT = profile(0)
# The newest batch only: it is acknowledged at once, whether or not it is read.
NEWEST = profile(1)
# The present state of something, also for readers that join later.
LATCHED = profile(1, is_latched=True)
CLOCK = profile(1, is_reliable=False)
