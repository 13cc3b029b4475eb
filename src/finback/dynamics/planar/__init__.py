"""Planar polynomial fields of any kind: equilibria, bifurcations, orbits, regions."""
