"""Campaigns: very many flights of one aircraft, by many processes, each flight a pure function of plan and number."""
