"""Continuation of any callable field, by finite differences."""
