"""Kernels over many trajectories: settling, escape, growth, chaotic sets."""
