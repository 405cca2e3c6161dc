"""A local web page on which the plane of initial conditions is looked at and touched."""
