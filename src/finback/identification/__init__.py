"""From flight records to polynomial models with covariance: the only bridge between the two."""
