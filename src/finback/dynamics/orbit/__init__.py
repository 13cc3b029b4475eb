"""Orbits of Liénard flows: series, half turns, manifolds, how they miss each other."""
