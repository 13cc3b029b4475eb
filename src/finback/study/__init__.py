"""From a study file to plans in SI, or to one complete error."""
