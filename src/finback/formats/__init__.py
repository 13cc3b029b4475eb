"""Files that other tools wrote: read as they are, with their own names and units."""
