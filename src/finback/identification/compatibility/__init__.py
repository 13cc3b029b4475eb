"""Whether the instruments of flights tell one motion, and which faults would make them: flight-path reconstruction."""
