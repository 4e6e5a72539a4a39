"""Prints: tags, boards, and the sheets that hold them. Knows neither cameras nor robots."""
