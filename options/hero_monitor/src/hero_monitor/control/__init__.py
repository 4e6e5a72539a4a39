"""Requests of pages, and what they make robots do."""
