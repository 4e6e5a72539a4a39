"""Procedures of a calibration, one module for each part. Pure."""
