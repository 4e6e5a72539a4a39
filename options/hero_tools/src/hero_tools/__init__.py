"""The fleet in a terminal, the checks of an installation, and the hotspot."""
