"""Melnikov estimates: Abelian integrals of the Hamiltonian limit."""
