"""Analyses of EVENT records alone, whether they come live or from a bag."""
