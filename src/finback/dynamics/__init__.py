"""Pure mathematics: polynomial planar systems, their equilibria and bifurcations. No aircraft is known here."""
