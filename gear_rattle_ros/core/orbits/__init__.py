"""Periodic orbits, stable or not: the section, the impact map, Newton's method, branches."""
