"""Limit cycles of Liénard flows and systems."""
