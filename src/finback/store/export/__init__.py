"""Models for other programs: SymPy, LaTeX, C, and an aircraft for JSBSim."""
