"""Round limits of axes."""


def nice_limit(largest: float, present: float) -> float:
    """Return a round limit of an axis above a number; the present one stays while it fits."""
    steps = [factor * 10.0**power for power in range(-9, 5) for factor in (1.0, 1.5, 2.0, 3.0,
                                                                           5.0, 7.0)]

    def above(number: float) -> float:
        return next((step for step in steps if step >= number), steps[-1])

    if present >= largest and present > 0.0:
        return min(present, above(1.3 * largest))
    return above(1.05 * largest)
