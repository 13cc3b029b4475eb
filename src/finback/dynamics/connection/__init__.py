"""Saddle loops and connections."""
