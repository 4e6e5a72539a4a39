"""Screens and pages that tests read: of programs with a window, of a browser, and of the monitor."""
