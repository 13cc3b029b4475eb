"""Stability regions, and the absence of limit cycles."""
