"""Which terms a model needs: found from a library of candidates, not assumed."""
