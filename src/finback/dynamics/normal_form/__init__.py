"""The quadratic and cubic systems of the paper, exactly."""
