"""Two-parameter diagrams of a family of flows."""
