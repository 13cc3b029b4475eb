"""What residuals give away that no coefficient can mend: turbulence, stall hysteresis, inputs that act late."""
