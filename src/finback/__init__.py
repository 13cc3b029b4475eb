"""Finback: a validation harness for reduced models of high-angle-of-attack flight."""

from importlib.metadata import version

__version__ = version("finback")
