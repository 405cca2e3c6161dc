"""A local web page for exploring the plane of initial conditions."""
