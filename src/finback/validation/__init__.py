"""Judging a model: its predictions against the full simulator, each with an uncertainty and a sourced tolerance."""
