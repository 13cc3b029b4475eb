"""Models in coefficient form for other programs: SymPy, LaTeX, C, and an aircraft that flies at any airspeed."""
