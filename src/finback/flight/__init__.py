"""Flying a JSBSim aircraft: the only room that knows JSBSim."""
