"""Flights worth flying: inputs matched to a mode, and sets of maneuvers chosen for the model that is wanted."""
