"""What is printed: tags, boards, and the sheets that hold them. Knows neither cameras nor robots."""
