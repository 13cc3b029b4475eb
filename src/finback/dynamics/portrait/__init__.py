"""Phase portraits as data."""
