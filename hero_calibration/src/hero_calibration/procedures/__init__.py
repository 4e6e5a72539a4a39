"""What robots are taken through, one module for each part of a calibration. Pure."""
