"""Figures, the report and recordings, made from finished results: the only importer of matplotlib and rerun."""
